#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "o80/robot.hpp"
#include "pam/plant.hpp"
#include "pam/presets.hpp"

namespace o80::pam {

O80_DESCRIBE_ENUM(Preset, standard, identified, published_simulation);

/// The law of the muscles.
enum class Law : std::uint8_t { of_preset, linear, hill };
O80_DESCRIBE_ENUM(Law, of_preset, linear, hill);

/// The pressure ranges of the muscles.
enum class Ranges : std::uint8_t { of_preset, simulated, real };
O80_DESCRIBE_ENUM(Ranges, of_preset, simulated, real);

/// Source of a muscle's activation: the pressure's share of its range, or the pressure in bar.
enum class ActivatedBy : std::uint8_t { of_preset, range, bar };
O80_DESCRIBE_ENUM(ActivatedBy, of_preset, range, bar);

/// Value of an option that the preset determines.
inline constexpr Joints kOfPreset{-1.0, -1.0, -1.0, -1.0};

/// Sensor values beside the pressures.
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
             (bars, "pressure in the muscles [bar]"), (activations, "of the muscles, 0 to 1"),
             (racket_position, "centre of the racket in the world [m]"),
             (racket_rotation, "row by row; its second column is the normal of the blade"),
             (racket_velocity, "[m/s]"), (racket_angular_velocity, "in the world's axes [rad/s]"),
             (clipped, "the commanded pressure was out of range"));

/// The pneumatic arm as a robot: commands are the raw pressures of eight muscles, rows hold joint
/// angles.
///
/// Commanded pressures are rounded to whole raw units, as by the real arm's valves. Observed
/// pressures are those in the muscles, which lag behind.
class PamDriver {
 public:
  struct Config {
    Preset preset = Preset::standard;
    Law muscle = Law::of_preset;
    Ranges ranges = Ranges::of_preset;
    ActivatedBy activated_by = ActivatedBy::of_preset;
    double full_bar = kFullBar;
    Joints dead_time = kOfPreset;
    Joints lag = kOfPreset;
    Joints damping = kOfPreset;
    Joints friction = kOfPreset;
    Joints maximum_force = kOfPreset;
    Joints stroke = kOfPreset;
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

  /// Throws std::invalid_argument if an option is out of range.
  explicit PamDriver(const Config& config);

  void describe(Schema& schema) const;
  void start() {}
  void write(const Desired<PamDriver>& desired);
  void read(Reading<PamDriver>& reading) noexcept;
  void stop() noexcept {}

  Served on(const Reset& reset) noexcept;
  Served on(const Snapshot& snapshot) noexcept;
  Served on(const Restore& restore) noexcept;
  // for a replay that begins with a snapshot
  std::span<const std::byte> snapshot_bytes(std::uint32_t slot) const noexcept;
  bool load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) noexcept;

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
  State now_;  // without the plant's snapshots, which the plant holds
  std::vector<State> slots_;
  std::int64_t period_;  // [ns]
};
O80_DESCRIBE(PamDriver::Config,
             (preset, "numbers of the arm, unless they are given: as before, as identified, ..."),
             (muscle, "law of the muscles: linear, or of Hill type after Haeufle et al. (2014)"),
             (ranges, "pressure ranges: those of the published simulation, or of the real arm"),
             (activated_by, "what activates a muscle: the share of its range, or bars from 0 on"),
             (full_bar, "pressure of full activation, if it is bars that activate [bar]"),
             (dead_time, "of each joint until pressures begin to act; -1: of the preset [s]"),
             (lag, "of first order, of each joint's muscles; -1: of the preset [s]"),
             (damping, "of each joint; -1: of the preset [Nm s/rad]"),
             (friction, "dry, of each joint; -1: of the preset [Nm]"),
             (maximum_force, "of each joint's muscles; -1: of the preset [N]"),
             (stroke, "without force, of linear muscles; -1: of the preset [m]"),
             (period, "of an iteration, which sets the frequency [s]"),
             (substeps, "integration steps in a period"),
             (start_posture, "posture at the start, unless start_pressures are given [rad]"),
             (start_activation, "mean of two antagonists at the start, 0 to 1"),
             (start_pressures,
              "raw pressures at the start, in equilibrium; all 0: those that hold start_posture"),
             (start_noise,
              "on each joint at a reset, uniform within +- this value, drawn from the seed [rad]"),
             (slots, "for snapshots"));

}  // namespace o80::pam
