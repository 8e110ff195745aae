#pragma once

#include "balls/vector.hpp"

namespace o80::mujoco {

/// Position, orientation and velocities of a body.
struct Pose {
  Vector position{};  // [m]
  Rotation rotation{};
  Vector velocity{};  // of the position [m/s]
  Vector spin{};      // [rad/s], in the world's axes
};

/// Rigid motion from one pose to another, by shares of a step from 0 to 1: straight, with an
/// even rotation about one axis.
class Motion {
 public:
  Motion() = default;
  Motion(const Pose& from, const Pose& to) noexcept
      : from_(from), to_(to), turn_(turn_between(from.rotation, to.rotation)) {}

  const Pose& from() const noexcept { return from_; }
  const Pose& to() const noexcept { return to_; }
  Vector position(double share) const noexcept {
    return between(from_.position, to_.position, share);
  }
  double angle() const noexcept { return turn_.angle; }
  /// Displacement in the step [m].
  Vector travel() const noexcept { return to_.position - from_.position; }
  /// Transforms a point of the world to the frame of the body.
  Vector inside(const Vector& point, double share) const noexcept {
    if (share == 1) return to_.rotation.in(point - to_.position);
    const Vector relative = point - position(share);
    return from_.rotation.in(turn_.angle == 0 || share == 0
                                 ? relative
                                 : turned(relative, turn_.axis, -share * turn_.angle));
  }
  /// Transforms a direction of the body to the frame of the world.
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

/// Unexplained rotation in a step above which a body was teleported [rad].
inline constexpr double kTeleportAngle = 0.5;

/// True if the velocities at both ends of a motion of `step` [s] do not explain its displacement.
inline bool teleported(const Motion& motion, double step, double distance) noexcept {
  const Pose& from = motion.from();
  const Pose& to = motion.to();
  const Vector predicted = from.position + (0.5 * step) * (from.velocity + to.velocity);
  if (length(to.position - predicted) > distance) return true;
  return motion.angle() > 0.5 * step * (length(from.spin) + length(to.spin)) + kTeleportAngle;
}

/// Motion into a pose after a teleport, extrapolated from the velocity there.
inline Motion arriving_at(const Pose& pose, double step) noexcept {
  Pose from = pose;
  from.position = pose.position - step * pose.velocity;
  return {from, pose};
}

}  // namespace o80::mujoco
