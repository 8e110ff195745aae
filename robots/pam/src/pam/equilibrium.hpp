#pragma once

#include "pam/arm.hpp"
#include "pam/muscle.hpp"
#include "pam/pressure.hpp"

namespace o80::pam {

/// An arm and its muscles at rest: which pressures belong to which posture, and back.
struct Equilibrium {
  const Arm& arm;
  const Muscle& muscle;
  const PressureRanges& ranges;

  /// What the muscles do to the joints [Nm].
  Joints muscle_torque(const Joints& q, const Pressures& pressures) const noexcept;

  /// Pressures that hold a posture; `activation` is the mean of two antagonists where the ends of
  /// the ranges let it be. As near as they come if the posture cannot be held.
  Pressures pressures_holding(const Joints& q, double activation) const noexcept;

  /// The posture into which these pressures pull the arm, slowly, from `start`.
  Joints posture_held_by(const Pressures& pressures, const Joints& start) const noexcept;
};

}  // namespace o80::pam
