// Two joints between walls: one that is pushed against a wall halts by its error limit.

#include <algorithm>
#include <array>
#include <cmath>

#include "o80/robot.hpp"

class Colliding {
 public:
  struct Config {
    double wall = 0.5;
    double stuck = 10.0;
  };
  using Actuators = std::array<double, 2>;
  struct Sensors {
    std::array<double, 2> pushed;
  };
  using Extended = Sensors;
  using Requests = o80::Requests<o80::Reset>;

  explicit Colliding(const Config& config) : config_(config) {}

  void describe(o80::Schema& schema) const {
    schema.simulated();
    for (std::uint32_t i = 0; i < 2; ++i) {
      schema.actuator(i).limits(
          {.minimum = -1, .maximum = 1, .speed = 20.0, .acceleration = 4000.0, .error = 0.15});
    }
  }

  void start() {}
  void write(const o80::Desired<Colliding>& desired) {
    for (std::size_t i = 0; i < 2; ++i) {
      position_[i] = std::clamp(desired[i], -config_.wall, config_.wall);
      pushed_[i] = desired[i] - position_[i];
    }
  }
  void read(o80::Reading<Colliding>& reading) {
    reading.observed = position_;
    reading.extended.pushed = pushed_;
  }
  void stop() noexcept {}

  /// Refused to a copy whose first joint has been pushed beyond `stuck`, until it is reset.
  o80::Served resume() {
    if (std::abs(pushed_[0]) > config_.stuck) return o80::Served::rejected("it is stuck");
    return o80::Served::done();
  }
  o80::Served on(const o80::Reset& /*reset*/) {
    position_ = pushed_ = {};
    return o80::Served::start_afresh();
  }

 private:
  Config config_;
  std::array<double, 2> position_{};
  std::array<double, 2> pushed_{};
};
O80_DESCRIBE(Colliding::Sensors, (pushed, "how far beyond a wall a joint is asked to be [rad]"));
O80_DESCRIBE(Colliding::Config, (wall, "where the walls are, either way [rad]"),
             (stuck, "a joint that is pushed further beyond a wall refuses to resume [rad]"));

O80_ROBOT(colliding, Colliding);
