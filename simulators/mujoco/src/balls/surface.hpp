#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "balls/shape.hpp"
#include "balls/vector.hpp"

namespace o80::mujoco {

/// Where a body is and how it moves.
struct Pose {
  Vector position{};  // [m]
  Rotation rotation{};
  Vector velocity{};  // of the position [m/s]
  Vector spin{};      // [rad/s], in the world's axes
};

/// A rigid motion from one pose to another, by shares of a step from 0 to 1: straight, and turning
/// evenly about one axis.
class Motion {
 public:
  Motion() = default;
  Motion(const Pose& from, const Pose& to) noexcept
      : from_(from), to_(to), turn_(turn_between(from.rotation, to.rotation)) {}

  Vector position(double share) const noexcept {
    return between(from_.position, to_.position, share);
  }
  double angle() const noexcept { return turn_.angle; }
  /// How far it goes in the step [m].
  Vector travel() const noexcept { return to_.position - from_.position; }
  /// A point of the world, as the body sees it.
  Vector inside(const Vector& point, double share) const noexcept {
    const Vector relative = point - position(share);
    return from_.rotation.in(turn_.angle == 0 ? relative
                                              : turned(relative, turn_.axis, -share * turn_.angle));
  }
  /// A direction of the body, in the world.
  Vector outside(const Vector& direction, double share) const noexcept {
    const Vector out = from_.rotation.out(direction);
    return turn_.angle == 0 ? out : turned(out, turn_.axis, share * turn_.angle);
  }
  /// Velocity of a point of the body: v + omega x r [m/s].
  Vector velocity(const Vector& point, double share) const noexcept {
    return between(from_.velocity, to_.velocity, share) +
           cross(between(from_.spin, to_.spin, share), point - position(share));
  }

 private:
  Pose from_;
  Pose to_;
  Turn turn_;
};

/// Shares of the velocity, relative to the surface, that an impact leaves: along two tangents of
/// the surface and along its normal, in the order of the surface's axes with the normal last.
using Restitution = std::array<double, 3>;

enum class SurfaceKind : std::uint8_t { racket, table, net, floor };

/// Something a ball bounces on, during a step.
struct Surface {
  SurfaceKind kind = SurfaceKind::racket;
  Shape shape{};
  Restitution restitution{1, 1, 1};
  Motion motion{};
};

/// A ball leaves a surface at least this fast [m/s]: it hops on, it never rests.
inline constexpr double kSlowestRebound = 0.05;

/// The velocity after an impact [m/s]: what is kept of it, relative to the surface and along the
/// axes of its frame, the normal part turned round.
inline Vector reflected(const Vector& ball, const Vector& surface, const Vector& normal,
                        const std::array<Vector, 3>& axes, const Restitution& kept) noexcept {
  // the surface's axis nearest to the normal, and the two others laid into the tangent plane
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

}  // namespace o80::mujoco
