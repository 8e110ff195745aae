// error: each struct in a driver's Requests needs
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE

  using Requests = o80::Requests<Home>;

#ifndef RIGHT
  void on(Home&) {}
#else
  void on(const Home&) {}
#endif
};

ARM_AS_ROBOT
