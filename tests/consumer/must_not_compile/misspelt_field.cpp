// error: positon
#define ARM_STATE Sampled
#include "arm.hpp"

struct Sampled {
  double position;
};
#ifndef RIGHT
O80_DESCRIBE(Sampled, (positon, "[rad]"));
#else
O80_DESCRIBE(Sampled, (position, "[rad]"));
#endif

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
