#pragma once

#include "pam/arm.hpp"
#include "pam/muscle.hpp"
#include "pam/pressure.hpp"

namespace o80::pam {

/// Equilibrium of an arm and its muscles: converts postures to pressures, and back.
struct Equilibrium {
  const Arm& arm;
  const Muscles& muscles;
  const PressureRanges& ranges;
  const Joints& directions;  // see Plant::Config
  const Joints& neutral;

  /// Torque of the muscles on the joints [Nm].
  Joints muscle_torque(const Joints& q, const Pressures& pressures) const noexcept;

  /// Computes pressures that hold a posture. `activation`: mean of two antagonists, unless one
  /// reaches a limit of its range. Without a solution: the pressures nearest to one.
  Pressures pressures_holding(const Joints& q, double activation) const noexcept;

  /// Computes the stable posture for these pressures, reached from `start` without dynamics.
  Joints posture_held_by(const Pressures& pressures, const Joints& start) const noexcept;
};

}  // namespace o80::pam
