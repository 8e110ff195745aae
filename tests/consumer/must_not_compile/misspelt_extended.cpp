// error: a driver's sensor values are named by `using Extended
#include "o80/robot/make_table.hpp"

struct Joint {
  double position = 0.0;
};
O80_DESCRIBE(Joint, (position, "[rad]"));
struct Force {
  double x = 0.0;
};
O80_DESCRIBE(Force, x);

class Arm {
 public:
  struct Config {};
  using Actuators = std::array<Joint, 2>;
#ifndef RIGHT
  using Extension = Force;
#else
  using Extended = Force;
#endif

  explicit Arm(const Config&) {}
  void start() {}
  void write(const o80::Desired<Arm>&) {}
  void read(o80::Reading<Arm>&) {}
  void stop() noexcept {}
};
O80_DESCRIBE(Arm::Config);

O80_ROBOT(arm, Arm)
