// error: wait must be
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  bool wait(std::int64_t) { return true; }
#else
  void wait(std::int64_t) {}
#endif
};

ARM_AS_ROBOT
