// error: each struct in a driver's Requests needs
#include "o80/robot/make_table.hpp"

struct Joint {
  double position = 0.0;
};
O80_DESCRIBE(Joint, (position, "[rad]"));
struct Home {
  double speed = 1.0;
};
O80_DESCRIBE(Home, speed);

class Arm {
 public:
  struct Config {};
  using Actuators = std::array<Joint, 2>;
  using Requests = o80::Requests<Home>;

  explicit Arm(const Config&) {}
  void start() {}
  void write(const o80::Desired<Arm>&) {}
  void read(o80::Reading<Arm>&) {}
  void stop() noexcept {}
#ifndef RIGHT
  bool on(const Home&) { return true; }
#else
  o80::Served on(const Home&) { return o80::Served::done(); }
#endif
};
O80_DESCRIBE(Arm::Config);

O80_ROBOT(arm, Arm)
