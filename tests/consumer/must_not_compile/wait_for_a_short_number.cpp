// error: wait must be
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  void wait(int) {}
#else
  void wait(long long) {}
#endif
};

ARM_AS_ROBOT
