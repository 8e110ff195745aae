#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "balls/ball_flight.hpp"
#include "balls/sweep.hpp"

// Law of the bounce, one for all surfaces. Along the normal a share of the velocity is kept. In
// the tangent plane friction acts on the slip, the velocity of the ball's surface relative to the
// other one: a gripping ball loses a share of the slip, a sliding one no more than friction
// allows. The spin changes
// accordingly.

namespace o80::mujoco {

/// Least speed at which a ball leaves a surface [m/s], so that a ball hops and never rests.
inline constexpr double kSlowestRebound = 0.05;

/// Properties of a ball for the bounce.
struct Sphere {
  double radius = 0.02;        // [m]
  double inertia = 2.0 / 3.0;  // moment of inertia / (mass radius^2): 2/3 of a hollow ball

  /// Share of the slip that the velocity loses until the ball rolls.
  double rolling() const noexcept { return inertia / (1 + inertia); }
};

/// Normal and two tangents: perpendicular unit vectors. The first tangent is along an axis of
/// the surface.
struct Directions {
  Vector normal, first, second;

  /// Omits the surface's axis nearest to the normal, and projects the next one to the
  /// tangent plane.
  static Directions of(const Vector& normal, const std::array<Vector, 3>& axes) noexcept {
    std::size_t k = 0;
    for (std::size_t i = 1; i < 3; ++i) {
      if (std::abs(dot(axes[i], normal)) > std::abs(dot(axes[k], normal))) k = i;
    }
    const Vector& axis = axes[(k + 1) % 3];
    const Vector first = unit(axis - dot(axis, normal) * normal);
    return {normal, first, cross(normal, first)};
  }
};

/// Effect of friction along one tangent of a surface.
struct Friction {
  double taken = 0;  // loss of the ball's velocity [m/s]
  double given = 0;  // gain of spin, times inertia and radius [m/s]

  /// `velocity` of the ball relative to the surface, and `slip` of the ball's surface [m/s].
  static Friction of(double kept, double velocity, double slip, const Sphere& sphere) noexcept {
    const double grip = 1 - kept;
    if (grip <= 2 * sphere.rolling()) return {grip * slip, grip * slip};
    // more than any impulse at one point can take: the ball leaves rolling, and slower
    const double after = kept / (1 - sphere.rolling()) * (velocity - sphere.rolling() * slip);
    return {velocity - after, sphere.inertia * (slip - velocity + after)};
  }
};

/// Computes a bounce off a point that moves with `surface_velocity`.
inline Ball bounced(const Ball& before, const Vector& surface_velocity, const Directions& along,
                    const Restitution& kept, double friction, const Sphere& sphere) noexcept {
  const Vector relative = before.velocity - surface_velocity;
  const double approach = -dot(relative, along.normal);
  const double rebound = std::max(kept[2] * approach, kSlowestRebound);

  // velocity and slip => change by a grip, or less for a sliding ball
  const Vector slip = relative - sphere.radius * cross(before.spin, along.normal);
  const double velocity[2] = {dot(relative, along.first), dot(relative, along.second)};
  const Friction first = Friction::of(kept[0], velocity[0], dot(slip, along.first), sphere);
  const Friction second = Friction::of(kept[1], velocity[1], dot(slip, along.second), sphere);
  const double gripping = std::hypot(first.taken, second.taken);
  const double most = friction * (approach + rebound);
  const double share = gripping > most ? most / gripping : 1.0;

  Ball after = before;
  after.velocity = surface_velocity + (velocity[0] - share * first.taken) * along.first +
                   (velocity[1] - share * second.taken) * along.second + rebound * along.normal;
  const Vector given = first.given * along.first + second.given * along.second;
  after.spin =
      before.spin + (share / (sphere.inertia * sphere.radius)) * cross(along.normal, given);
  return after;
}

/// Computes a bounce; `before`: the ball at the contact.
inline Ball bounced(const Ball& before, const Contact& contact, const Sphere& sphere) noexcept {
  const Motion& motion = contact.surface->motion;
  const std::array<Vector, 3> axes{motion.outside({1, 0, 0}, contact.share),
                                   motion.outside({0, 1, 0}, contact.share),
                                   motion.outside({0, 0, 1}, contact.share)};
  return bounced(before, contact.surface_velocity, Directions::of(contact.normal, axes),
                 contact.surface->restitution, contact.surface->friction, sphere);
}

}  // namespace o80::mujoco
