#include "pam/equilibrium.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "pam/plant.hpp"

namespace o80::pam {
namespace {

/// `pull`: activation of the muscle that turns the joint towards larger angles.
double pair_torque(const Muscle& muscle, double angle, double pull, double counter_pull) {
  return std::visit(
      [&](const auto& law) {
        return kPulleyRadius * (law.resting_force(muscle_length(1.0, angle), pull) -
                                law.resting_force(muscle_length(-1.0, angle), counter_pull));
      },
      muscle);
}

/// Computes the activations of two antagonists with this mean and difference.
std::pair<double, double> around(double mean, double difference, const PressureRange& range,
                                 const PressureRange& counter_range) {
  return {std::clamp(mean + 0.5 * difference, range.least(), range.most()),
          std::clamp(mean - 0.5 * difference, counter_range.least(), counter_range.most())};
}

/// The muscles that turn a joint towards larger angles, and towards smaller ones.
std::size_t towards_larger(std::size_t joint, const Joints& directions) {
  return directions[joint] > 0 ? agonist(joint) : antagonist(joint);
}
std::size_t towards_smaller(std::size_t joint, const Joints& directions) {
  return directions[joint] > 0 ? antagonist(joint) : agonist(joint);
}

}  // namespace

Joints Equilibrium::muscle_torque(const Joints& q, const Pressures& pressures) const noexcept {
  Joints torque{};
  for (std::size_t j = 0; j < kJoints; ++j) {
    const std::size_t larger = towards_larger(j, directions);
    const std::size_t smaller = towards_smaller(j, directions);
    torque[j] =
        pair_torque(muscles[j], q[j] - neutral[j], ranges[larger].activation(pressures[larger]),
                    ranges[smaller].activation(pressures[smaller]));
  }
  return torque;
}

Pressures Equilibrium::pressures_holding(const Joints& q, double activation) const noexcept {
  const Joints needed = arm.gravity(q);
  Pressures pressures{};
  for (std::size_t j = 0; j < kJoints; ++j) {
    const std::size_t larger = towards_larger(j, directions);
    const std::size_t smaller = towards_smaller(j, directions);
    const auto shared = [&](double difference) {
      return around(activation, difference, ranges[larger], ranges[smaller]);
    };
    // bisection, because the torque grows with the difference of the activations
    double low = -2.0, high = 2.0;
    for (int i = 0; i < 50; ++i) {
      const double middle = 0.5 * (low + high);
      const auto [pull, counter_pull] = shared(middle);
      const bool weak = pair_torque(muscles[j], q[j] - neutral[j], pull, counter_pull) < needed[j];
      (weak ? low : high) = middle;
    }
    const auto [pull, counter_pull] = shared(0.5 * (low + high));
    const auto raw = [&](std::size_t m, double share) {
      return static_cast<std::int32_t>(std::lround(ranges[m].pressure(share)));
    };
    pressures[larger] = raw(larger, pull);
    pressures[smaller] = raw(smaller, counter_pull);
  }
  return pressures;
}

Joints Equilibrium::posture_held_by(const Pressures& pressures,
                                    const Joints& start) const noexcept {
  // descends the potential energy of muscles and gravity to a stable equilibrium
  constexpr double gravity_stiffness = 10.0;  // [Nm/rad], more than that of gravity
  constexpr double probe_angle = 1e-5;        // [rad]
  Joints q = start;
  for (int i = 0; i < 5000; ++i) {
    Joints probe = q;
    for (double& angle : probe) angle += probe_angle;
    const Joints torque = muscle_torque(q, pressures);
    const Joints probed = muscle_torque(probe, pressures);
    const Joints gravity = arm.gravity(q);
    double largest = 0.0;
    for (std::size_t j = 0; j < kJoints; ++j) {
      const double stiffness =
          std::max(0.0, (torque[j] - probed[j]) / probe_angle) + gravity_stiffness;
      const double next =
          std::clamp(q[j] + (torque[j] - gravity[j]) / stiffness, -kJointLimit, kJointLimit);
      largest = std::max(largest, std::abs(next - q[j]));
      q[j] = next;
    }
    if (largest < 1e-14) break;
  }
  return q;
}

}  // namespace o80::pam
