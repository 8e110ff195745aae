#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "o80/robot.hpp"
#include "two_joints_model.hpp"

/// Request that takes time: the robot moves by itself until its joints are at 0.
struct Home {
  static constexpr std::string_view kHelp = "moves the joints to 0, one after the other";
  double speed = 1.0;
};
O80_DESCRIBE(Home, (speed, "[rad/s]"));

/// Tutorial robot: two simulated joints, which follow the desired states with a lag.
class TwoJoints {
 public:
  struct Config {
    double gain = 20.0;
    double reach = 3.0;
  };
  struct Sensors {
    bool homing;  // its padding is part of every test with this robot
    std::array<double, 2> effort;
  };
  using Actuators = std::array<double, 2>;  // positions [rad]
  using Extended = Sensors;
  using Requests = o80::Requests<o80::Reset, o80::Snapshot, o80::Restore, Home>;

  explicit TwoJoints(const Config& config) : config_(config) {
    refuse_unless_above_0("gain", config.gain);
    refuse_unless_above_0("reach", config.reach);
  }

  void describe(o80::Schema& schema) const {
    schema.simulated();
    const o80::Limits limits{.minimum = -config_.reach, .maximum = config_.reach};
    schema.actuator(0).name("shoulder").limits(limits).unit("rad");
    schema.actuator(1).name("elbow").limits(limits);
    schema.shown.mjcf = kTwoJointsModel;
    schema.actuator("shoulder").moves_joint("shoulder");
    schema.actuator("elbow").moves_joint("elbow");
  }

  void start() {}

  void write(const o80::Desired<TwoJoints>& desired) {
    if (now_.mode == Mode::homes) move_home(desired.period());
    if (now_.mode != Mode::follows) return;
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
    tell_of_home(reading);
    if (reading.fresh()) now_.mode = Mode::follows;  // desired states begin at the observed ones
    reading.extended.homing = now_.mode == Mode::homes;
    reading.go_on_from(now_.desired);  // has an effect after a reset or a restore only
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

  // for a replay that begins with a snapshot
  std::span<const std::byte> snapshot_bytes(std::uint32_t slot) const {
    if (slot >= kept_.size()) return {};
    return std::as_bytes(std::span(&kept_[slot], 1));
  }
  bool load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) {
    if (slot >= kept_.size() || bytes.size() != sizeof(State)) return false;
    kept_[slot] = o80::unpack<State>(bytes.data());
    return true;
  }

  o80::Served on(const Home& home) {
    if (!(home.speed > 0)) return o80::Served::rejected("speed must be positive");
    now_.mode = Mode::homes;
    now_.speed = home.speed;
    now_.effort = {};
    return o80::Served::running("begins");
  }

  void stop() noexcept {}

 private:
  enum class Mode : std::uint8_t {
    follows,  // desired positions
    homes,    // moves by itself
    stays     // position reached by homing, until a fresh start
  };
  struct State {
    std::array<double, 2> position{};
    std::array<double, 2> effort{};
    std::array<double, 2> desired{};
    Mode mode = Mode::follows;
    double speed = 0;  // of homing [rad/s]
  };

  static void refuse_unless_above_0(const std::string& option, double value) {
    if (value > 0) return;
    throw std::invalid_argument(option + " must be positive, got " + std::to_string(value));
  }

  void move_home(double period) {
    for (double& position : now_.position) {
      if (position == 0) continue;
      position -= std::clamp(position, -now_.speed * period, now_.speed * period);
      return;
    }
  }

  void tell_of_home(o80::Reading<TwoJoints>& reading) {
    const bool is_home = now_.position == std::array<double, 2>{};
    if (!reading.runs<Home>()) {
      if (now_.mode == Mode::homes) stay();  // ended by a halt
    } else if (now_.mode != Mode::homes) {
      reading.ended<Home>(o80::Served::rejected("a reset or a restore has ended it"));
    } else if (is_home) {
      stay();
      reading.ended<Home>(o80::Served::start_afresh());
    } else {
      reading.progress<Home>(now_.position[0] != 0 ? "the shoulder moves" : "the elbow moves");
    }
  }

  void stay() {
    now_.mode = Mode::stays;
    now_.desired = now_.position;
  }

  Config config_;
  State now_;
  std::array<State, 8> kept_;
};

O80_DESCRIBE(TwoJoints::Config, (gain, "how fast a joint closes in on what is asked [1/s]"),
             (reach, "largest angle of a joint, either way [rad]"));
O80_DESCRIBE(TwoJoints::Sensors, (homing, "it moves to 0 by itself"),
             (effort, "what is asked less what is there [rad]"));
