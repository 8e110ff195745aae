// error: Requests must be `o80::Requests<...>`
#include <tuple>
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
#ifndef RIGHT
  using Requests = std::tuple<Home>;
#else
  using Requests = o80::Requests<Home>;
#endif

  explicit Arm(const Config&) {}
  void start() {}
  void write(const o80::Desired<Arm>&) {}
  void read(o80::Reading<Arm>&) {}
  void stop() noexcept {}
  void on(const Home&) {}
};
O80_DESCRIBE(Arm::Config);

O80_ROBOT(arm, Arm)
