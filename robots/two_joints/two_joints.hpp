#pragma once

#include <array>
#include <cmath>

#include "o80/o80.hpp"

/// The tutorial robot: two simulated joints, each of which follows what is asked with a lag.
class TwoJoints {
 public:
  struct Config {
    double gain = 20.0;
    double reach = 3.0;
  };
  struct Sensors {
    std::array<double, 2> effort;
  };
  using Actuators = std::array<double, 2>;  // positions [rad]
  using Extended = Sensors;
  using Requests = o80::Requests<o80::Reset, o80::Snapshot, o80::Restore>;

  explicit TwoJoints(const Config& config) : config_(config) {}

  void describe(o80::Schema& schema) const {
    const o80::Limits limits{.minimum = -config_.reach, .maximum = config_.reach};
    schema.actuator(0).name("shoulder").limits(limits);
    schema.actuator(1).name("elbow").limits(limits);
  }

  void start() {}

  void write(const o80::Desired<TwoJoints>& desired) {
    const double share = 1.0 - std::exp(-config_.gain * desired.period());
    for (std::size_t i = 0; i < 2; ++i) {
      now_.effort[i] = desired[i] - now_.position[i];
      now_.position[i] += share * now_.effort[i];
    }
    now_.desired = desired.states;
  }

  void read(o80::Reading<TwoJoints>& reading) {
    reading.observed = now_.position;
    reading.extended.effort = now_.effort;
    reading.go_on_from(now_.desired);  // heard after a reset or a restore only
  }

  o80::Served on(const o80::Reset&) {
    now_ = {};
    return o80::Served::start_afresh();
  }
  o80::Served on(const o80::Snapshot& snapshot) {
    if (snapshot.slot >= kept_.size()) return o80::Served::rejected("there are slots 0 to 7");
    kept_[snapshot.slot] = now_;
    return o80::Served::done();
  }
  o80::Served on(const o80::Restore& restore) {
    if (restore.slot >= kept_.size()) return o80::Served::rejected("there are slots 0 to 7");
    now_ = kept_[restore.slot];
    return o80::Served::start_afresh();
  }

  void stop() noexcept {}

 private:
  struct State {
    std::array<double, 2> position{};
    std::array<double, 2> effort{};
    std::array<double, 2> desired{};
  };

  Config config_;
  State now_;
  std::array<State, 8> kept_;
};

O80_DESCRIBE(TwoJoints::Config, (gain, "how fast a joint closes in on what is asked [1/s]"),
             (reach, "largest angle of a joint, either way [rad]"));
O80_DESCRIBE(TwoJoints::Sensors, (effort, "what is asked less what is there [rad]"));
