// error: a driver needs `void stop() noexcept`
#ifndef RIGHT
#define ARM_STOP \
  int stop() noexcept { return 1; }
#endif
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
