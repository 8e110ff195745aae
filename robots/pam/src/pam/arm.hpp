#pragma once

#include <array>
#include <numbers>
#include <optional>
#include <type_traits>

#include "pam/pressure.hpp"

namespace o80::pam {

using Vector = std::array<double, 3>;
using Rotation = std::array<double, 9>;  ///< row by row; its columns are the axes of the body
using JointMatrix = std::array<Joints, kJoints>;

// The kinematic chain [m]. At zero angles, it points straight upwards from the base.
inline constexpr double kShoulderHeight = 0.075;    ///< joint 2 above the base
inline constexpr double kUpperArmLength = 0.36742;  ///< joint 2 to joint 3
inline constexpr double kForearmLength = 0.370;     ///< joint 3 to the centre of the racket
inline constexpr double kJointLimit = 89.8 * std::numbers::pi / 180.0;  ///< [rad], either side

/// Half axes of the elliptic blade, across and along the forearm, and its thickness [m]. The normal
/// of the blade is the y axis of the racket.
inline constexpr double kBladeHalfWidth = 0.5 * 0.1485;
inline constexpr double kBladeHalfLength = 0.5 * 0.1882;
inline constexpr double kBladeThickness = 0.0054;

/// Moving part. The centre of mass is on the z axis of the joint's frame; the principal axes
/// are parallel to the axes of the frame.
struct Link {
  double mass = 0.0;    ///< [kg]
  double centre = 0.0;  ///< [m], along z from the joint
  Vector inertia{};     ///< [kg m^2], about the centre of mass
};

/// The links moved by joint 1 (shoulder), 2 (upper arm), 3 (elbow) and 4 (forearm with racket).
using Links = std::array<Link, kJoints>;

/// Links from the published masses. Fittings and handle are solid balls of 30 and 20 mm radius,
/// tubes are thin-walled, and the blade is a thin elliptic plate with the fitted mass of the
/// racket.
Links published_links() noexcept;

/// The two parts of the fourth link: forearm with handle, and racket.
Link published_forearm() noexcept;
Link published_racket() noexcept;

/// Merges two parts of a body to one link.
Link joined(const Link& a, const Link& b) noexcept;

/// Angles and speeds of the joints [rad, rad/s].
struct Motion {
  Joints q{};
  Joints dq{};
};
static_assert(std::is_trivially_copyable_v<Motion>);

/// Pose and velocity of the centre of the racket in the world.
struct RacketMotion {
  Vector position{};  ///< [m]
  Rotation rotation{};
  Vector velocity{};          ///< [m/s]
  Vector angular_velocity{};  ///< [rad/s], in the world's axes
};

/// Rigid-body dynamics of the arm: M(q) ddq + bias(q, dq) + damping dq = torque.
class Arm {
 public:
  struct Config {
    Vector base{0.0, 0.0, 1.21};                  ///< [m], in the world
    double gravity = 9.81;                        ///< [m/s^2]
    Joints damping{2.0, 2.0, 1.2, 1.5};           ///< [Nm s/rad], of bearings and tendons
    Joints friction{};                            ///< [Nm], dry, of bearings and tendons
    Joints armature{0.003, 0.003, 0.003, 0.003};  ///< [kg m^2], of pulleys, tendons and muscles
  };

  Arm() noexcept : Arm(Config{}) {}
  explicit Arm(const Config& config) noexcept : config_(config), links_(published_links()) {}

  const Config& config() const noexcept { return config_; }

  JointMatrix mass_matrix(const Joints& q) const noexcept;        ///< [kg m^2], with armature
  Joints bias(const Joints& q, const Joints& dq) const noexcept;  ///< [Nm], gravity and Coriolis
  Joints gravity(const Joints& q) const noexcept { return bias(q, Joints{}); }
  Joints acceleration(const Motion& motion,
                      const Joints& torque) const noexcept;  ///< without stops
  double energy(const Motion& motion) const noexcept;        ///< [J], kinetic and potential

  /// Integrates by `duration` [s]: semi-implicit Euler with implicit damping and friction. The
  /// stops at ±kJointLimit are inelastic and never passed.
  void advance(Motion& motion, const Joints& torque, double duration) const noexcept;

  RacketMotion racket(const Motion& motion) const noexcept;

  /// Inverse kinematics: computes the angles (elbow up) that bring the racket's centre to a point
  /// of the world, for an angle of the wrist; nullopt if the point is out of reach.
  std::optional<Joints> posture_reaching(const Vector& point, double wrist) const noexcept;

 private:
  struct Plane;

  JointMatrix mass_matrix(const Plane& plane) const noexcept;
  Joints bias(const Plane& plane, const Joints& dq) const noexcept;

  Config config_;
  Links links_;
};

}  // namespace o80::pam
