// error: resume must be `void resume()` or `o80::Served resume()`
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  bool resume() { return true; }
#else
  o80::Served resume() { return o80::Served::done(); }
#endif
};

ARM_AS_ROBOT
