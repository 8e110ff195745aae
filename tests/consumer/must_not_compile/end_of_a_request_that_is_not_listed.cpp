// error: this struct is not among the Requests of the driver
#define ARM_READ \
  void read(o80::Reading<Arm>& reading) { reading.ended<Home>(o80::Served::done()); }
#include "arm.hpp"

class Arm {
  ARM_WITHOUT_MISTAKE
#ifdef RIGHT
  using Requests = o80::Requests<Home>;
  o80::Served on(const Home&) { return o80::Served::running(); }
#endif
};

ARM_AS_ROBOT
