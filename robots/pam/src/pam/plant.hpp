#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "pam/arm.hpp"
#include "pam/muscle.hpp"
#include "pam/pressure.hpp"

namespace o80::pam {

struct Equilibrium;

/// Radius of the pulleys through which the muscles turn the joints [m].
inline constexpr double kPulleyRadius = 0.037;

/// First-order lag between pressure and activation [s].
inline constexpr Joints kActivationLag{0.016, 0.044, 0.044, 0.044};

/// Near the median posture of the real arm in recorded play [rad].
inline constexpr Joints kPlayingPosture{0.17, 1.1, 1.04, 0.5};

/// Longest dead time [periods].
inline constexpr std::size_t kLongestDeadTime = 127;

/// Simulated arm: `advance` takes eight pressures and integrates one period.
///
/// Realtime: everything but the constructor; no allocation, no lock, no exception. Two plants with
/// the same configuration and state stay equal bit for bit under the same pressures.
class Plant {
 public:
  struct Config {
    MuscleModel muscle = MuscleModel::linear;
    PressureRanges ranges = kSimulatedRanges;
    double period = 0.002;  ///< [s]
    int substeps = 4;       ///< integration steps in a period
    Arm::Config arm{};
    Joints maximum_force{1500.0, 1500.0, 1500.0, 1500.0};  ///< [N], of each muscle of a joint
    Joints stroke{0.10, 0.10, 0.10, 0.10};                 ///< [m], of linear muscles
    Joints lag = kActivationLag;                           ///< [s]
    /// [s], from a commanded pressure to the first change in the muscle; rounded to whole
    /// periods.
    Joints dead_time{};
    /// 1: the agonist of the joint turns it towards larger angles; -1: towards smaller ones.
    Joints directions{1.0, 1.0, 1.0, 1.0};
    Joints neutral{};  ///< [rad], angles at which the two muscles of a joint have equal lengths
    /// Pressures at the start, in whose posture the arm rests; unset: the pressures that
    /// hold `start_posture`.
    std::optional<Pressures> start_pressures{};
    Joints start_posture = kPlayingPosture;  ///< [rad]
    double start_activation = 0.5;  ///< mean of two antagonists, if start_pressures are unset
    double start_noise = 0.0;       ///< [rad], uniform within ± this, from the seed of a reset
  };

  /// Complete state: a copy is a snapshot, for `restore`.
  struct State {
    std::int64_t iteration = 0;
    Motion motion{};
    std::array<double, kMuscles> activation{};
    std::array<double, kMuscles> fibre_length{};  ///< [m], Hill model
    Pressures commanded{};                        ///< raw, within the ranges
    /// The last commanded pressures, a ring: the newest is at iteration % size.
    std::array<Pressures, kLongestDeadTime + 1> requested{};
    std::int64_t clipped = 0;  ///< iterations with a pressure out of range
  };
  static_assert(std::is_trivially_copyable_v<State>);

  /// Pressures out of range: bit m for muscle m.
  using Clipped = std::uint8_t;
  static_assert(kMuscles <= 8);

  Plant() : Plant(Config{}) {}

  /// Throws std::invalid_argument if a value of the configuration is out of range.
  explicit Plant(const Config& config);

  const Config& config() const noexcept { return config_; }
  const Arm& arm() const noexcept { return arm_; }
  /// Muscles of each joint.
  const Muscles& muscles() const noexcept { return muscles_; }
  /// Laws of this plant at rest.
  Equilibrium equilibrium() const noexcept;

  /// The pressures that hold the arm in its start posture.
  const Pressures& start_pressures() const noexcept { return start_pressures_; }

  /// Integrates one period with these pressures, and with further torques on the joints [Nm].
  /// Pressures out of range are clamped; the result marks them.
  Clipped advance(const Pressures& pressures, const Joints& external = {}) noexcept;

  /// Returns to the start. The seed has an effect only with `start_noise`.
  void reset(std::uint64_t seed) noexcept;

  const State& state() const noexcept { return state_; }
  void restore(const State& state) noexcept { state_ = state; }

  const Joints& q() const noexcept { return state_.motion.q; }    ///< [rad]
  const Joints& dq() const noexcept { return state_.motion.dq; }  ///< [rad/s]
  Pressures pressures() const noexcept;                           ///< raw, in the muscles
  std::array<double, kMuscles> bars() const noexcept;             ///< [bar], in the muscles
  RacketMotion racket() const noexcept { return arm_.racket(state_.motion); }

 private:
  template <MuscleLaw Law>
  void integrate(const std::array<double, kMuscles>& target, const Joints& external) noexcept;
  void settle_muscles() noexcept;
  /// 1 if a muscle turns its joint towards larger angles, else -1.
  double side(std::size_t muscle) const noexcept {
    return muscle % 2 == 0 ? config_.directions[muscle / 2] : -config_.directions[muscle / 2];
  }

  Config config_;
  Arm arm_;
  Muscles muscles_;
  std::array<std::int64_t, kJoints> delay_{};  // iterations of dead time
  double substep_;                             // [s]
  Joints lag_gain_;  // share of the remaining difference that an activation covers in a substep
  Pressures start_pressures_{};
  Joints start_equilibrium_{};
  State state_{};
};

/// Length of a muscle [m] with its joint at `angle`. `side`: 1 for a muscle that turns the joint
/// towards larger angles, at which it is shorter, else -1.
constexpr double muscle_length(double side, double angle) noexcept {
  return kRestLength + (side > 0 ? -kPulleyRadius : kPulleyRadius) * angle;
}

}  // namespace o80::pam
