// error: a driver needs `void start()`
#ifndef RIGHT
#define ARM_START \
  bool start() { return false; }
#endif
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
