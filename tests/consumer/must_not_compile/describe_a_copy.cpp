// error: describe must be
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  void describe(int) const {}
#else
  void describe(o80::Schema&) const {}
#endif
};

ARM_AS_ROBOT
