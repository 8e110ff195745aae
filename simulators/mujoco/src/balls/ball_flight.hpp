#pragma once

#include <cmath>
#include <numbers>

#include "balls/vector.hpp"

namespace o80::mujoco {

/// Position, velocity and spin of a ball.
struct Ball {
  Vector position{};  // [m]
  Vector velocity{};  // [m/s]
  Vector spin{};      // [rad/s], in the world's axes
  bool operator==(const Ball&) const = default;
};

/// Forces of air and gravity on one kind of ball:
/// a = -drag |v| v + magnus / (1 + saturation |omega| / |v|) (omega x v) + gravity.
/// The lift grows less than the spin, because the surface cannot turn the flow without limit.
struct Air {
  double drag = 0;        // 1/2 rho Cd A/m [1/m]
  double magnus = 0;      // 1/2 rho Cl A r/m []
  double spin_decay = 0;  // share of the spin lost in a second [1/s]
  Vector gravity{0, 0, -9.81};
  double saturation = 0;  // of the lift [m]

  struct Coefficients {
    double drag = 0;             // Cd
    double lift = 0;             // Cl per r |omega| / |v|, of a slow spin
    double lift_saturation = 0;  // the lift is halved at r |omega| / |v| = 1 / lift_saturation
  };
  static Air of(double density, const Coefficients& coefficients, double radius, double mass,
                double spin_decay, const Vector& gravity) noexcept {
    const double per_coefficient = 0.5 * density * std::numbers::pi * radius * radius / mass;
    return {coefficients.drag * per_coefficient, coefficients.lift * per_coefficient * radius,
            spin_decay, gravity, coefficients.lift_saturation * radius};
  }
};

/// Computes the acceleration of a ball [m/s^2].
inline Vector acceleration(const Air& air, const Vector& velocity, const Vector& spin) noexcept {
  const double speed = length(velocity);
  const double turning = air.saturation * length(spin);
  const double magnus = turning > 0 ? air.magnus * (speed / (speed + turning)) : air.magnus;
  return magnus * cross(spin, velocity) - (air.drag * speed) * velocity + air.gravity;
}

/// Moves a ball by `duration` [s] of free flight, by a classical Runge-Kutta step with the spin at
/// the middle.
inline Ball flown(const Ball& ball, const Air& air, double duration) noexcept {
  const double half = 0.5 * duration;
  const double halfway = std::exp(-air.spin_decay * half);
  const Vector spin = halfway * ball.spin;
  const Vector v1 = ball.velocity;
  const Vector a1 = acceleration(air, v1, spin);
  const Vector v2 = ball.velocity + half * a1;
  const Vector a2 = acceleration(air, v2, spin);
  const Vector v3 = ball.velocity + half * a2;
  const Vector a3 = acceleration(air, v3, spin);
  const Vector v4 = ball.velocity + duration * a3;
  const Vector a4 = acceleration(air, v4, spin);
  const double sixth = duration / 6;
  return {ball.position + sixth * (v1 + 2 * v2 + 2 * v3 + v4),
          ball.velocity + sixth * (a1 + 2 * a2 + 2 * a3 + a4), halfway * spin};
}

}  // namespace o80::mujoco
