// error: a driver needs `void write(
#ifndef RIGHT
#define ARM_WRITE \
  bool write(const o80::Desired<Arm>&) { return false; }
#endif
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
