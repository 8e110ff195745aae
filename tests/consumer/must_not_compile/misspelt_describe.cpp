// error: rename it to `describe`
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  void desribe(o80::Schema&) const {}
#else
  void describe(o80::Schema&) const {}
#endif
};

ARM_AS_ROBOT
