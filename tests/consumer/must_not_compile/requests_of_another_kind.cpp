// error: Requests must be `o80::Requests<...>`
#include <tuple>
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  using Requests = std::tuple<Home>;
#else
  using Requests = o80::Requests<Home>;
#endif
  void on(const Home&) {}
};

ARM_AS_ROBOT
