// error: a driver with `on(...)` must list its requests
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifdef RIGHT
  using Requests = o80::Requests<Home>;
#endif
  void on(const Home&) {}
};

ARM_AS_ROBOT
