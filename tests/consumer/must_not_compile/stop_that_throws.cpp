// error: a driver needs `void stop() noexcept`
#ifndef RIGHT
#define ARM_STOP \
  void stop() {}
#endif
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
