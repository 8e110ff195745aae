// error: a state is a number, a described enum or a struct that O80_DESCRIBE describes
#define ARM_STATE Sampled
#include "arm.hpp"

struct Sampled {
  double position;
};
#ifdef RIGHT
O80_DESCRIBE(Sampled, (position, "[rad]"));
#endif

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
