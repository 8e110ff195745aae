// error: a driver needs `void read(
#ifndef RIGHT
#define ARM_READ
#endif
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
