// error: a driver's Requests must be public
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
 private:
#endif
  using Requests = o80::Requests<Home>;

 public:
  void on(const Home&) {}
};

ARM_AS_ROBOT
