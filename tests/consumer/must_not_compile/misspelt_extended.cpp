// error: a driver names its sensor values by `using Extended
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
