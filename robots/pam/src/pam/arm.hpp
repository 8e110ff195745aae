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

// The chain, at angles of zero a straight line upwards from the base (all in [m]).
inline constexpr double kShoulderHeight = 0.075;    ///< joint 2 above the base
inline constexpr double kUpperArmLength = 0.36742;  ///< joint 2 to joint 3
inline constexpr double kForearmLength = 0.370;     ///< joint 3 to the centre of the racket
inline constexpr double kJointLimit = 89.8 * std::numbers::pi / 180.0;  ///< [rad], either side

/// Half axes of the elliptic blade, across and along the forearm, and its thickness [m]. Its face
/// looks along its own y axis.
inline constexpr double kBladeHalfWidth = 0.5 * 0.1485;
inline constexpr double kBladeHalfLength = 0.5 * 0.1882;
inline constexpr double kBladeThickness = 0.0054;

/// One moving part. Its centre of mass lies on the z axis of its joint's frame, its principal axes
/// are those of the frame.
struct Link {
  double mass = 0.0;    ///< [kg]
  double centre = 0.0;  ///< [m], along z from the joint
  Vector inertia{};     ///< [kg m^2], about the centre of mass
};

/// The links moved by joint 1 (shoulder), 2 (upper arm), 3 (elbow) and 4 (forearm with racket).
using Links = std::array<Link, kJoints>;

/// From the published masses. Fittings and handle are solid balls of 30 and 20 mm radius, tubes are
/// thin-walled, the blade is a thin elliptic plate that carries the fitted mass of the racket.
Links published_links() noexcept;

/// Forearm, handle and racket, of which the fourth link is made.
Link published_forearm() noexcept;
Link published_racket() noexcept;

/// Several parts of one body as one.
Link joined(const Link& a, const Link& b) noexcept;

/// Angles and speeds of the joints [rad, rad/s].
struct Motion {
  Joints q{};
  Joints dq{};
};
static_assert(std::is_trivially_copyable_v<Motion>);

/// Where the centre of the racket is in the world and how it moves.
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
    Joints armature{0.003, 0.003, 0.003, 0.003};  ///< [kg m^2], pulley, tendon and muscle in motion
  };

  Arm() noexcept : Arm(Config{}) {}
  explicit Arm(const Config& config) noexcept : config_(config), links_(published_links()) {}

  const Config& config() const noexcept { return config_; }

  JointMatrix mass_matrix(const Joints& q) const noexcept;        ///< [kg m^2], with armature
  Joints bias(const Joints& q, const Joints& dq) const noexcept;  ///< [Nm], gravity and Coriolis
  Joints gravity(const Joints& q) const noexcept { return bias(q, Joints{}); }
  Joints acceleration(const Motion& motion, const Joints& torque) const noexcept;  ///< no stops
  double energy(const Motion& motion) const noexcept;  ///< [J], kinetic and of height

  /// Moves on by `duration` [s]: semi-implicit, damping implicit, the stops at ±kJointLimit
  /// inelastic and never passed.
  void advance(Motion& motion, const Joints& torque, double duration) const noexcept;

  RacketMotion racket(const Motion& motion) const noexcept;

  /// Angles (joints 1 to 3, elbow up) that bring the centre of the racket to a point of the world,
  /// with the given angle of the wrist; nothing if it is out of reach.
  std::optional<Joints> posture_reaching(const Vector& point, double wrist) const noexcept;

 private:
  Config config_;
  Links links_;
};

}  // namespace o80::pam
