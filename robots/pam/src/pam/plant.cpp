#include "pam/plant.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "pam/equilibrium.hpp"

namespace o80::pam {
namespace {

// Draws a random number by SplitMix64, which is good for any seed.
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
    const std::int32_t minimum = config.ranges[m].minimum;
    const std::int32_t maximum = config.ranges[m].maximum;
    require(minimum < maximum, "the range of muscle " + std::to_string(m) + ", " +
                                   std::to_string(minimum) + " to " + std::to_string(maximum) +
                                   ", is empty");
    require(config.ranges[m].idle < config.ranges[m].full && std::isfinite(config.ranges[m].full),
            "full_bar must be positive and finite");
    if (!config.start_pressures) continue;
    const std::int32_t start = (*config.start_pressures)[m];
    require(start >= minimum && start <= maximum,
            "start_pressures: muscle " + std::to_string(m) + " takes " + std::to_string(minimum) +
                " to " + std::to_string(maximum) + ", got " + std::to_string(start));
  }
  for (std::size_t j = 0; j < kJoints; ++j) {
    const std::string joint = " of joint " + std::to_string(j + 1);
    const auto positive = [&](double value, const char* name) {
      require(value > 0.0 && std::isfinite(value),
              name + joint + " must be positive and finite, got " + std::to_string(value));
    };
    const auto not_negative = [&](double value, const char* name) {
      require(value >= 0.0 && std::isfinite(value),
              name + joint + " must be finite and not negative, got " + std::to_string(value));
    };
    positive(config.maximum_force[j], "maximum_force");
    positive(config.stroke[j], "stroke");
    positive(config.lag[j], "lag");
    not_negative(config.dead_time[j], "dead_time");
    not_negative(config.arm.damping[j], "damping");
    not_negative(config.arm.friction[j], "friction");
    require(std::abs(config.neutral[j]) <= kJointLimit,
            "neutral" + joint + " must be within the stops at 89.8 degrees, got " +
                std::to_string(config.neutral[j]) + " rad");
    require(config.directions[j] == 1.0 || config.directions[j] == -1.0,
            "directions" + joint + " must be 1 or -1, got " + std::to_string(config.directions[j]));
    const double longest = config.period * static_cast<double>(kLongestDeadTime);
    require(config.dead_time[j] <= longest,
            "dead_time" + joint + " must be at most " + std::to_string(longest) + " s (" +
                std::to_string(kLongestDeadTime) + " periods), got " +
                std::to_string(config.dead_time[j]));
  }
  for (double angle : config.start_posture) {
    require(std::abs(angle) <= kJointLimit,
            "start_posture must be within the stops at 89.8 degrees, got " + std::to_string(angle) +
                " rad");
  }
}

}  // namespace

Plant::Plant(const Config& config)
    : config_(config), arm_(config.arm), substep_(config.period / config.substeps) {
  check(config);
  for (std::size_t j = 0; j < kJoints; ++j) {
    lag_gain_[j] = -std::expm1(-substep_ / config.lag[j]);
    muscles_[j] = make_muscle(config.muscle, config.maximum_force[j], config.stroke[j]);
    delay_[j] = std::llround(config.dead_time[j] / config.period);
  }
  const Equilibrium rest = equilibrium();
  start_pressures_ = config.start_pressures.value_or(
      rest.pressures_holding(config.start_posture, config.start_activation));
  start_equilibrium_ = rest.posture_held_by(start_pressures_, config.start_posture);
  reset(0);
}

Equilibrium Plant::equilibrium() const noexcept {
  return {arm_, muscles_, config_.ranges, config_.directions, config_.neutral};
}

void Plant::reset(std::uint64_t seed) noexcept {
  state_ = State{.motion = {.q = start_equilibrium_}, .commanded = start_pressures_};
  state_.requested.fill(start_pressures_);
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
    const double length = muscle_length(side(m), state_.motion.q[m / 2] - config_.neutral[m / 2]);
    state_.fibre_length[m] = std::visit(
        [&](const auto& law) { return law.resting_fibre_length(length, state_.activation[m]); },
        muscles_[m / 2]);
  }
}

Plant::Clipped Plant::advance(const Pressures& pressures, const Joints& external) noexcept {
  // pressures => target activations
  Clipped clipped = 0;
  std::array<double, kMuscles> target;
  for (std::size_t m = 0; m < kMuscles; ++m) {
    const std::int32_t minimum = config_.ranges[m].minimum;
    const std::int32_t maximum = config_.ranges[m].maximum;
    state_.commanded[m] = std::clamp(pressures[m], minimum, maximum);
    if (state_.commanded[m] != pressures[m]) clipped |= static_cast<Clipped>(1u << m);
  }

  // dead time: the muscles follow earlier commands
  const auto newest = static_cast<std::size_t>(state_.iteration) % state_.requested.size();
  state_.requested[newest] = state_.commanded;
  for (std::size_t m = 0; m < kMuscles; ++m) {
    const std::size_t back = static_cast<std::size_t>(delay_[m / 2]);
    const std::size_t then = (newest + state_.requested.size() - back) % state_.requested.size();
    target[m] = config_.ranges[m].activation(state_.requested[then][m]);
  }

  // activations => motion
  std::visit([&]<class Law>(const Law&) { integrate<Law>(target, external); }, muscles_[0]);
  ++state_.iteration;
  if (clipped != 0) ++state_.clipped;
  return clipped;
}

template <MuscleLaw Law>
void Plant::integrate(const std::array<double, kMuscles>& target, const Joints& external) noexcept {
  std::array<const Law*, kJoints> laws{};
  for (std::size_t j = 0; j < kJoints; ++j) laws[j] = std::get_if<Law>(&muscles_[j]);
  for (int step = 0; step < config_.substeps; ++step) {
    Joints torque = external;
    for (std::size_t m = 0; m < kMuscles; ++m) {
      const std::size_t joint = m / 2;
      const double way = side(m);
      state_.activation[m] += lag_gain_[joint] * (target[m] - state_.activation[m]);
      const Pull pull =
          laws[joint]->pull(muscle_length(way, state_.motion.q[joint] - config_.neutral[joint]),
                            -way * kPulleyRadius * state_.motion.dq[joint], state_.fibre_length[m],
                            state_.activation[m]);
      torque[joint] += way * kPulleyRadius * pull.force;
      state_.fibre_length[m] += substep_ * pull.fibre_velocity;
    }
    arm_.advance(state_.motion, torque, substep_);
  }
}

Pressures Plant::pressures() const noexcept {
  Pressures raw{};
  for (std::size_t m = 0; m < kMuscles; ++m) {
    raw[m] = rounded(config_.ranges[m].pressure(state_.activation[m]));
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
