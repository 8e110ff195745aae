// error: halt must be `void halt()`
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  void halt(bool) {}
#else
  void halt() {}
#endif
};

ARM_AS_ROBOT
