#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "driver/simulation.hpp"
#include "o80/robot.hpp"

namespace o80::mujoco {

/// Forgets what happened to a ball, and begins to note it anew.
struct ClearContacts {
  static constexpr std::string_view kHelp = "forget what balls have met";
  std::uint32_t ball = 0;
};
O80_DESCRIBE(ClearContacts, (ball, "which, counted from 1; 0: all of them"));

/// Any MuJoCo model as a robot: joints or controls and balls in, their states, sensors and contacts
/// out.
class MujocoDriver {
 public:
  using Config = mujoco::Config;
  using Actuators = RunTimeActuators;
  using Requests = o80::Requests<Reset, Snapshot, Restore, ClearContacts>;

  /// Throws DriverError.
  explicit MujocoDriver(const Config& config);

  void describe(Schema& schema) const;
  void start() {}
  void write(const Desired<MujocoDriver>& desired);
  void read(Reading<MujocoDriver>& reading);
  void stop() noexcept {}

  Served on(const Reset& reset) noexcept;
  Served on(const Snapshot& snapshot) noexcept;
  Served on(const Restore& restore) noexcept;
  Served on(const ClearContacts& which) noexcept;

  const Simulation& simulation() const noexcept { return simulation_; }

 private:
  using Number = Place<double>;
  /// Where everything lies in a row.
  struct Places {
    std::vector<Place<JointState>> joints;
    std::vector<Number> controls;
    std::vector<Place<BallState>> balls;
    std::vector<Place<BallRecord>> records;
    std::vector<Place<JointState>> seen_joints;  // of controlled joints
    std::vector<Number> sensors;
    Place<std::array<double, 3>> racket_position;
    Place<std::array<double, 3>> racket_velocity;
    Place<std::int64_t> clock;
    Place<std::uint32_t> engine_contacts;
    std::uint32_t first_ball = 0;  // actuator
  };
  Places add_to(Schema& schema) const;
  /// Throws DriverError if no whole number of steps lasts so long [ns].
  std::uint32_t steps_in(std::int64_t period) const;
  void go_on_from_targets(Reading<MujocoDriver>& reading);
  Served no_such_slot() const noexcept;

  Simulation simulation_;
  std::uint32_t steps_;  // 0: as many as the period holds
  Places places_;
  bool steps_known_ = false;
};

}  // namespace o80::mujoco
