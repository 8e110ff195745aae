#pragma once

#include <cstdint>

#include "control/record.hpp"

namespace o80 {

/// Fraction of the distance at the fraction `t` of the time of a minimum-jerk motion from rest to
/// rest (Flash and Hogan 1985), and its first two derivatives.
constexpr double minimum_jerk(double t) noexcept {
  return t * t * t * (10.0 + t * (-15.0 + 6.0 * t));
}
constexpr double minimum_jerk_slope(double t) noexcept {
  return 30.0 * t * t * (1.0 - t) * (1.0 - t);
}
constexpr double minimum_jerk_curvature(double t) noexcept {
  return t * (60.0 + t * (-180.0 + 120.0 * t));
}

/// Velocity and acceleration of one number.
struct Moment {
  double velocity = 0.0;      // [1/iteration]
  double acceleration = 0.0;  // [1/iteration^2]
};

/// A motion that fades to rest. Its velocity is a cubic polynomial from the velocity and
/// acceleration at the start to velocity 0 and acceleration 0. The velocity never changes its sign.
struct Fading {
  double velocity = 0.0;
  double acceleration = 0.0;
  double time = 0.0;  // [iterations]; 0: at rest at once

  /// The fading motion of the longest duration, at most `most`, that moves by at most `up` or
  /// `down` (distances, not negative).
  static Fading of(const Moment& start, double most, double up, double down) noexcept;

  /// Distance of the whole motion.
  constexpr double distance() const noexcept {
    return time * (velocity / 2.0 + acceleration * time / 12.0);
  }
  /// Distance after t iterations.
  double position(double t) const noexcept;
  /// Velocity and acceleration after t iterations.
  Moment at(double t) const noexcept;
};

/// Iterations of a linear motion at `speed` [1/iteration], rounded up, at least 1.
std::int64_t linear_iterations(double distance, double speed) noexcept;

/// Iterations of a minimum-jerk motion from rest whose peak speed is at most `speed` [1/iteration].
std::int64_t minimum_jerk_iterations(double distance, double speed) noexcept;

/// Highest speed of the sum of a fading motion from `velocity` in at most n iterations and a
/// minimum-jerk motion over `distance` in n iterations. An upper bound; exact if the acceleration
/// at the start is 0.
double highest_speed(double velocity, double distance, double n) noexcept;

}  // namespace o80
