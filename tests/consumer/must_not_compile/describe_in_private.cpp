// error: describe must be
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
 private:
#endif
  void describe(o80::Schema&) const {}
};

ARM_AS_ROBOT
