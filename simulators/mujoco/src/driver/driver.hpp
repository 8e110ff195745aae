#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "balls/ball_requests.hpp"
#include "balls/ball_rows.hpp"
#include "driver/simulation.hpp"
#include "o80/robot.hpp"

namespace o80::mujoco {

/// Any MuJoCo model as a robot. Commands set joints or controls, and balls; rows hold their states
/// and the model's sensors.
class MujocoDriver {
 public:
  using Config = mujoco::Config;
  using Actuators = RunTimeActuators;
  using Requests = o80::Requests<Reset, Snapshot, Restore>;  // describe() adds others

  /// Throws DriverError.
  explicit MujocoDriver(const Config& config);

  void describe(Schema& schema) const;
  void start();
  void write(const Desired<MujocoDriver>& desired);
  void read(Reading<MujocoDriver>& reading);
  void stop() noexcept {}
  Served resume() noexcept;

  Served on(const Reset& reset) noexcept;
  Served on(const Snapshot& snapshot) noexcept;
  Served on(const Restore& restore) noexcept;
  // for a replay that begins with a snapshot
  std::span<const std::byte> snapshot_bytes(std::uint32_t slot) noexcept {
    return simulation_.snapshot_bytes(slot);
  }
  bool load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) noexcept {
    return simulation_.load_snapshot(slot, bytes);
  }
  Served on(std::uint32_t request, const std::byte* payload) noexcept;

 private:
  using Number = Place<double>;
  /// Offsets of all values in a row.
  struct Places {
    std::vector<Place<JointState>> joints;
    std::vector<Number> controls;
    BallRows balls;
    Place<std::int64_t> clock;
    std::vector<Place<JointState>> joint_sensors;  // in mode control
    Place<std::uint32_t> engine_contacts;
    std::vector<Number> sensors;
    std::vector<BodyRow> bodies;
  };
  Places add_to(Schema& schema) const;
  void take_face(Schema& schema) const;
  void add_actuators(Schema& schema, Places& places) const;
  void add_sensors(Schema& schema, Places& places) const;
  void show(Schema& schema, const Places& places) const;
  void read_sensors(Reading<MujocoDriver>& reading) const;
  void go_on_from_targets(Reading<MujocoDriver>& reading);
  Served no_such_slot() const noexcept;
  Served serve_as_arm(JointFace::Word word, const std::byte* payload) noexcept;
  const std::optional<JointFace>& face() const noexcept { return simulation_.model().face; }

  Simulation simulation_;
  std::uint32_t steps_;  // 0: as many as the period holds
  bool is_like_;         // has the face of another robot
  bool restored_ = false;
  std::vector<std::uint32_t> commanded_;  // actuators of a relaxed robot, in the last iteration
  // as described, if engine steps are shortened to fill it; else 0 [ns]
  mutable std::int64_t period_ = 0;
  Places places_;
  bool steps_known_ = false;
};

}  // namespace o80::mujoco
