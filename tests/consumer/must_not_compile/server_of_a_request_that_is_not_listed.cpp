// error: this struct is not among the Requests of the robot
#include <array>

#include "o80/o80.hpp"

struct Arm {
  using Actuators = std::array<double, 2>;
#ifdef RIGHT
  using Requests = o80::Requests<o80::Reset>;
#endif
};

void serve(o80::Backend<Arm>& backend) {
  backend.on<o80::Reset>([](const o80::Reset&) { return o80::Served::done(); });
}
