// error: a driver's Extended must be a struct of numbers
#include "arm.hpp"

struct Torque {
  double x;
};

class Arm {
  ARM_WITHOUT_MISTAKE
#ifndef RIGHT
  using Extended = Torque;
#else
  using Extended = Force;
#endif
};

ARM_AS_ROBOT
