// error: a driver needs `void read(
#ifndef RIGHT
#define ARM_READ \
  bool read(o80::Reading<Arm>&) { return false; }
#endif
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
