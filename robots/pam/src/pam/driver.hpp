#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "o80/robot.hpp"
#include "pam/plant.hpp"

namespace o80::pam {

O80_DESCRIBE_ENUM(MuscleModel, linear, hill);

/// Whose pressures may be asked for.
enum class Ranges : std::uint8_t { simulated, real };
O80_DESCRIBE_ENUM(Ranges, simulated, real);

/// What the arm's sensors say beside the pressures.
struct ArmSensors {
  Joints joint_positions{};
  Joints joint_velocities{};
  std::array<double, kMuscles> bars{};
  std::array<double, kMuscles> activations{};
  Vector racket_position{};
  Rotation racket_rotation{};
  Vector racket_velocity{};
  Vector racket_angular_velocity{};
  std::array<bool, kMuscles> clipped{};
};
O80_DESCRIBE(ArmSensors, (joint_positions, "[rad]"), (joint_velocities, "[rad/s]"),
             (bars, "in the muscles now [bar]"), (activations, "of the muscles now, 0 to 1"),
             (racket_position, "centre of the racket in the world [m]"),
             (racket_rotation, "row by row; the blade looks along its second column"),
             (racket_velocity, "[m/s]"), (racket_angular_velocity, "in the world's axes [rad/s]"),
             (clipped, "a pressure asked for was out of range"));

/// The pneumatic arm as a robot: raw pressures of eight muscles in, joint angles out.
///
/// What is asked of a muscle is rounded to whole raw units, as its valve does; what is observed is
/// the lagging pressure in it.
class PamDriver {
 public:
  struct Config {
    MuscleModel muscle = MuscleModel::linear;
    Ranges ranges = Ranges::simulated;
    double period = 0.002;
    std::int32_t substeps = 4;
    Joints start_posture = kPlayingPosture;
    double start_activation = 0.5;
    Pressures start_pressures{};
    double start_noise = 0.0;
    std::uint32_t slots = 8;
  };
  using Actuators = std::array<double, kMuscles>;
  using Extended = ArmSensors;
  using Requests = o80::Requests<Reset, Snapshot, Restore>;

  /// Throws std::invalid_argument on a configuration that makes no arm.
  explicit PamDriver(const Config& config);

  void describe(Schema& schema) const;
  void start() {}
  void write(const Desired<PamDriver>& desired);
  void read(Reading<PamDriver>& reading) noexcept;
  void stop() noexcept {}

  Served on(const Reset& reset) noexcept;
  Served on(const Snapshot& snapshot) noexcept;
  Served on(const Restore& restore) noexcept;

  const Plant& plant() const noexcept { return plant_; }

 private:
  struct State {
    Plant::State plant{};
    Actuators desired{};
    Actuators observed{};
    Plant::Clipped clipped = 0;
    std::uint8_t filled = 0;
  };
  void begin() noexcept;
  Served no_such_slot() const noexcept;

  Plant plant_;
  State now_;  // but for the plant, which holds its own
  std::vector<State> slots_;
  std::int64_t period_;  // [ns]
};
O80_DESCRIBE(PamDriver::Config,
             (muscle, "law of the muscles: linear, or of Hill type after Haeufle et al. (2014)"),
             (ranges, "which pressures may be asked for: those of the simulation or the real arm"),
             (period, "of an iteration; the frequency follows it [s]"),
             (substeps, "integration steps in a period"),
             (start_posture, "where the arm starts, unless start_pressures are given [rad]"),
             (start_activation, "mean of two antagonists at the start, 0 to 1"),
             (start_pressures, "that hold the arm where it starts; all 0: as its posture needs"),
             (start_noise, "on each joint at a reset, uniform in +- this, from its seed [rad]"),
             (slots, "for snapshots"));

}  // namespace o80::pam
