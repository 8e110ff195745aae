// error: each struct in a driver's Requests needs
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE

  using Requests = o80::Requests<Home>;

#ifndef RIGHT
  bool on(const Home&) { return true; }
#else
  o80::Served on(const Home&) { return o80::Served::done(); }
#endif
};

ARM_AS_ROBOT
