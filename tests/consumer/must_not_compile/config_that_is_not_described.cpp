// error: a driver's Config must be described
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
};

#ifdef RIGHT
O80_DESCRIBE(Arm::Config);
#endif
O80_ROBOT(arm, Arm)
