// error: a driver's sensor values are named by `using Extended
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  using Extension = Force;
#else
  using Extended = Force;
#endif
};

ARM_AS_ROBOT
