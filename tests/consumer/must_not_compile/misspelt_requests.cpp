// error: a driver lists its requests as
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  using Requets = o80::Requests<Home>;
#else
  using Requests = o80::Requests<Home>;
#endif
  void on(const Home&) {}
};

ARM_AS_ROBOT
