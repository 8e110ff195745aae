// error: Sampled::samples cannot be shared between processes
#define ARM_STATE Sampled
#include "arm.hpp"

struct Sampled {
  double position;
#ifndef RIGHT
  double* samples;
#else
  std::array<double, 3> samples;
#endif
};
O80_DESCRIBE(Sampled, (position, "[rad]"), (samples, "of the last millisecond"));

class Arm {
  ARM_WITHOUT_MISTAKE
};

ARM_AS_ROBOT
