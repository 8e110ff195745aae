// error: a driver's verb is called `halt`
#include "o80/robot/make_table.hpp"

struct Joint {
  double position = 0.0;
};
O80_DESCRIBE(Joint, (position, "[rad]"));

class Arm {
 public:
  struct Config {};
  using Actuators = std::array<Joint, 2>;

  explicit Arm(const Config&) {}
  void start() {}
  void write(const o80::Desired<Arm>&) {}
  void read(o80::Reading<Arm>&) {}
  void stop() noexcept {}
#ifndef RIGHT
  void on_halt() {}
#else
  void halt() {}
#endif
};
O80_DESCRIBE(Arm::Config);

O80_ROBOT(arm, Arm)
