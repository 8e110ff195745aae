// error: describe must be `void describe(o80::Schema& schema) const`
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  void describe(o80::Schema&) {}
#else
  void describe(o80::Schema&) const {}
#endif
};

ARM_AS_ROBOT
