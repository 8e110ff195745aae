#pragma once

#include "pam/arm.hpp"
#include "pam/muscle.hpp"
#include "pam/pressure.hpp"

namespace o80::pam {

/// An arm and its muscles at rest: from a posture to its pressures, and back.
struct Equilibrium {
  const Arm& arm;
  const Muscles& muscles;
  const PressureRanges& ranges;
  const Joints& directions;  // see Plant::Config
  const Joints& neutral;

  /// Torque of the muscles on the joints [Nm].
  Joints muscle_torque(const Joints& q, const Pressures& pressures) const noexcept;

  /// Pressures that hold a posture. `activation` is the mean of two antagonists, unless one of them
  /// reaches the end of its range. If the posture cannot be held: the pressures nearest to that.
  Pressures pressures_holding(const Joints& q, double activation) const noexcept;

  /// The stable posture into which these pressures pull the arm from `start`, without dynamics.
  Joints posture_held_by(const Pressures& pressures, const Joints& start) const noexcept;
};

}  // namespace o80::pam
