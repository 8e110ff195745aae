#pragma once

#include <cstdint>

#include "control/record.hpp"

namespace o80 {

/// Share of the way at the share `t` of the time of a minimum-jerk motion from rest to rest (Flash
/// and Hogan 1985), and its first two derivatives.
constexpr double minimum_jerk(double t) noexcept {
  return t * t * t * (10.0 + t * (-15.0 + 6.0 * t));
}
constexpr double minimum_jerk_slope(double t) noexcept {
  return 30.0 * t * t * (1.0 - t) * (1.0 - t);
}
constexpr double minimum_jerk_curvature(double t) noexcept {
  return t * (60.0 + t * (-180.0 + 120.0 * t));
}

/// How one number moves on.
struct Moment {
  double velocity = 0.0;      // [1/iteration]
  double acceleration = 0.0;  // [1/iteration^2]
};

/// A motion that fades to rest: its velocity is a cubic from the one at the start, with its
/// acceleration, to 0 without acceleration. The velocity never changes its sign.
struct Fading {
  double velocity = 0.0;
  double acceleration = 0.0;
  double time = 0.0;  // [iterations], 0: at rest at once

  /// Over the longest time, at most `most`, in which it gets no further than `up` or `down` (both
  /// distances, not negative).
  static Fading of(const Moment& start, double most, double up, double down) noexcept;

  /// How far it gets in all.
  constexpr double distance() const noexcept {
    return time * (velocity / 2.0 + acceleration * time / 12.0);
  }
  /// How far it is after t iterations, and how it moves then.
  double position(double t) const noexcept;
  Moment at(double t) const noexcept;
};

/// Iterations of a linear motion at `speed` [1/iteration], rounded up, at least 1.
std::int64_t linear_iterations(double distance, double speed) noexcept;

/// Iterations of a minimum-jerk motion from rest whose peak does not exceed `speed` [1/iteration].
std::int64_t minimum_jerk_iterations(double distance, double speed) noexcept;

/// The highest speed of a fading motion at `velocity`, drawn out over n iterations or less, plus a
/// minimum jerk over `distance` in n iterations: an upper bound that is met if the acceleration at
/// the start is 0.
double highest_speed(double velocity, double distance, double n) noexcept;

}  // namespace o80
