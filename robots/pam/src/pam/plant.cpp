#include "pam/plant.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "pam/equilibrium.hpp"

namespace o80::pam {
namespace {

// A random number by SplitMix64, whose sequence is good from any seed.
double uniform(std::uint64_t& seed, double low, double high) {
  seed += 0x9E3779B97F4A7C15u;
  std::uint64_t z = seed;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  z ^= z >> 31;
  return low + (high - low) * (static_cast<double>(z >> 11) * 0x1.0p-53);
}

void require(bool holds, const std::string& what) {
  if (!holds) throw std::invalid_argument("pneumatic arm: " + what);
}

void check(const Plant::Config& config) {
  require(config.period > 0.0 && std::isfinite(config.period),
          "period must be positive and finite, got " + std::to_string(config.period) + " s");
  require(config.substeps >= 1,
          "substeps must be at least 1, got " + std::to_string(config.substeps));
  require(config.start_activation >= 0.0 && config.start_activation <= 1.0,
          "start_activation must be from 0 to 1, got " + std::to_string(config.start_activation));
  require(config.start_noise >= 0.0,
          "start_noise must not be negative, got " + std::to_string(config.start_noise));
  for (std::size_t m = 0; m < kMuscles; ++m) {
    const auto [minimum, maximum] = config.ranges[m];
    require(minimum < maximum, "the range of muscle " + std::to_string(m) + ", " +
                                   std::to_string(minimum) + " to " + std::to_string(maximum) +
                                   ", is empty");
    if (!config.start_pressures) continue;
    const std::int32_t start = (*config.start_pressures)[m];
    require(start >= minimum && start <= maximum,
            "start_pressures: muscle " + std::to_string(m) + " takes " + std::to_string(minimum) +
                " to " + std::to_string(maximum) + ", got " + std::to_string(start));
  }
  for (double angle : config.start_posture) {
    require(std::abs(angle) <= kJointLimit,
            "start_posture must be within the stops at 89.8 degrees, got " + std::to_string(angle) +
                " rad");
  }
}

}  // namespace

Plant::Plant(const Config& config)
    : config_(config),
      arm_(config.arm),
      muscle_(make_muscle(config.muscle)),
      substep_(config.period / config.substeps) {
  check(config);
  for (std::size_t j = 0; j < kJoints; ++j) {
    lag_gain_[j] = -std::expm1(-substep_ / kActivationLag[j]);
  }
  const Equilibrium rest{arm_, muscle_, config_.ranges};
  start_pressures_ = config.start_pressures.value_or(
      rest.pressures_holding(config.start_posture, config.start_activation));
  start_equilibrium_ = rest.posture_held_by(start_pressures_, config.start_posture);
  reset(0);
}

void Plant::reset(std::uint64_t seed) noexcept {
  state_ = State{.motion = {.q = start_equilibrium_}, .commanded = start_pressures_};
  if (config_.start_noise > 0.0) {
    for (double& angle : state_.motion.q) {
      angle = std::clamp(angle + uniform(seed, -config_.start_noise, config_.start_noise),
                         -kJointLimit, kJointLimit);
    }
  }
  settle_muscles();
}

/// Puts every muscle into the steady state of its pressure and length.
void Plant::settle_muscles() noexcept {
  for (std::size_t m = 0; m < kMuscles; ++m) {
    state_.activation[m] = config_.ranges[m].activation(state_.commanded[m]);
    const double length = muscle_length(m, state_.motion.q[m / 2]);
    state_.fibre_length[m] = std::visit(
        [&](const auto& law) { return law.resting_fibre_length(length, state_.activation[m]); },
        muscle_);
  }
}

Plant::Clipped Plant::advance(const Pressures& pressures, const Joints& external) noexcept {
  // pressures => target activations
  Clipped clipped = 0;
  std::array<double, kMuscles> target;
  for (std::size_t m = 0; m < kMuscles; ++m) {
    const auto [minimum, maximum] = config_.ranges[m];
    state_.commanded[m] = std::clamp(pressures[m], minimum, maximum);
    target[m] = config_.ranges[m].activation(state_.commanded[m]);
    if (state_.commanded[m] != pressures[m]) clipped |= static_cast<Clipped>(1u << m);
  }

  // activations => motion
  std::visit([&](const auto& law) { integrate(law, target, external); }, muscle_);
  ++state_.iteration;
  if (clipped != 0) ++state_.clipped;
  return clipped;
}

template <MuscleLaw Law>
void Plant::integrate(const Law& law, const std::array<double, kMuscles>& target,
                      const Joints& external) noexcept {
  for (int step = 0; step < config_.substeps; ++step) {
    Joints torque = external;
    for (std::size_t m = 0; m < kMuscles; ++m) {
      const std::size_t joint = m / 2;
      const double side = m == agonist(joint) ? 1.0 : -1.0;
      state_.activation[m] += lag_gain_[joint] * (target[m] - state_.activation[m]);
      const Pull pull = law.pull(muscle_length(m, state_.motion.q[joint]),
                                 -side * kPulleyRadius * state_.motion.dq[joint],
                                 state_.fibre_length[m], state_.activation[m]);
      torque[joint] += side * kPulleyRadius * pull.force;
      state_.fibre_length[m] += substep_ * pull.fibre_velocity;
    }
    arm_.advance(state_.motion, torque, substep_);
  }
}

Pressures Plant::pressures() const noexcept {
  Pressures raw{};
  for (std::size_t m = 0; m < kMuscles; ++m) {
    raw[m] =
        static_cast<std::int32_t>(std::lround(config_.ranges[m].pressure(state_.activation[m])));
  }
  return raw;
}

std::array<double, kMuscles> Plant::bars() const noexcept {
  std::array<double, kMuscles> bars{};
  for (std::size_t m = 0; m < kMuscles; ++m) {
    bars[m] = to_bar(config_.ranges[m].pressure(state_.activation[m]));
  }
  return bars;
}

}  // namespace o80::pam
