// error: rename it to `resume`
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  o80::Served resme() { return o80::Served::done(); }
#else
  o80::Served resume() { return o80::Served::done(); }
#endif
};

ARM_AS_ROBOT
