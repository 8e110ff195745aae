#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "balls/ball_flight.hpp"
#include "balls/sweep.hpp"

// The law of the bounce, one for all surfaces: shares of the relative velocity are kept, the spin
// stays as it is.

namespace o80::mujoco {

/// A ball leaves a surface at least this fast [m/s], so that it hops and never rests.
inline constexpr double kSlowestRebound = 0.05;

/// The velocity after a bounce [m/s]: the shares `kept` of the velocity relative to the surface,
/// along two tangents and the normal; the normal part changes its sign.
inline Vector reflected(const Vector& ball, const Vector& surface, const Vector& normal,
                        const std::array<Vector, 3>& axes, const Restitution& kept) noexcept {
  // the surface's axis nearest to the normal; the two others are projected on the tangent plane
  std::size_t k = 0;
  for (std::size_t i = 1; i < 3; ++i) {
    if (std::abs(dot(axes[i], normal)) > std::abs(dot(axes[k], normal))) k = i;
  }
  const Vector& axis = axes[(k + 1) % 3];
  const Vector first = unit(axis - dot(axis, normal) * normal);
  const Vector second = cross(normal, first);

  const Vector relative = ball - surface;
  const double rebound = std::max(-kept[2] * dot(relative, normal), kSlowestRebound);
  return surface + (kept[0] * dot(relative, first)) * first +
         (kept[1] * dot(relative, second)) * second + rebound * normal;
}

/// A ball after a bounce; `before` is the ball at the contact.
inline Ball bounced(const Ball& before, const Contact& contact) noexcept {
  const Motion& motion = contact.surface->motion;
  const std::array<Vector, 3> axes{motion.outside({1, 0, 0}, contact.share),
                                   motion.outside({0, 1, 0}, contact.share),
                                   motion.outside({0, 0, 1}, contact.share)};
  Ball after = before;
  after.velocity = reflected(before.velocity, contact.surface_velocity, contact.normal, axes,
                             contact.surface->restitution);
  return after;
}

}  // namespace o80::mujoco
