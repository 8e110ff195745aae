// error: rename it to `halt`
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  void on_halt() {}
#else
  void halt() {}
#endif
};

ARM_AS_ROBOT
