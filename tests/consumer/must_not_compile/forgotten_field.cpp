// error: Sampled: describe every field, once
#define ARM_STATE Sampled
#include "arm.hpp"

struct Sampled {
  double position;
  double velocity;
};
#ifndef RIGHT
O80_DESCRIBE(Sampled, (position, "[rad]"));
#else
O80_DESCRIBE(Sampled, (position, "[rad]"), (velocity, "[rad/s]"));
#endif

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
