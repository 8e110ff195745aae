// error: wait must be `void wait(std::int64_t due)`
#include <chrono>
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  void wait(std::chrono::nanoseconds) {}
#else
  void wait(std::int64_t) {}
#endif
};

ARM_AS_ROBOT
