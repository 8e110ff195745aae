#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "balls/motion.hpp"
#include "balls/shape.hpp"

namespace o80::mujoco {

/// Shares of the relative velocity that a ball without spin keeps at a bounce: along two tangents
/// of the surface and along its normal, in the order of the surface's axes with the normal last.
using Restitution = std::array<double, 3>;

/// Friction of a surface without sliding.
inline constexpr double kNoSliding = std::numeric_limits<double>::infinity();

/// Surface on which balls bounce, during a step.
struct Surface {
  Shape shape{};
  Restitution restitution{1, 1, 1};
  double friction = kNoSliding;  // largest tangential force over normal force
  bool watched = false;          // see BallOptions::watched
  std::size_t record = 0;        // index of the record among watched, or among other, surfaces
  Motion motion{};
};

}  // namespace o80::mujoco
