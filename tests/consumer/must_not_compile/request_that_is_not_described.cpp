// error: each of o80::Requests must be a struct of numbers that O80_DESCRIBE describes
#include "arm.hpp"

struct Grasp {
  double force = 1.0;
};
#ifdef RIGHT
O80_DESCRIBE(Grasp, force);
#endif

class Arm {
  ARM_WITHOUT_MISTAKE
  using Requests = o80::Requests<Grasp>;
  void on(const Grasp&) {}
};

ARM_AS_ROBOT
