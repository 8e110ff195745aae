#pragma once

#include <cstdint>

#include "o80/control/record.hpp"

namespace o80 {

/// Share of the way, in position, at the share `t` of the time of a minimum-jerk motion from rest
/// to rest (Flash and Hogan 1985).
constexpr double minimum_jerk(double t) noexcept {
  return t * t * t * (10.0 + t * (-15.0 + 6.0 * t));
}

/// How far a motion of one number has come, and how it moves on.
struct Moment {
  double position = 0.0;
  double velocity = 0.0;      // [1/iteration]
  double acceleration = 0.0;  // [1/iteration^2]
};

/// Weights of distance, initial velocity and initial acceleration in a quintic that ends at rest.
struct QuinticWeights {
  double distance;
  double velocity;
  double acceleration;

  /// Of the position at the share `t` of the time.
  static constexpr QuinticWeights position(double t) noexcept {
    const double t2 = t * t;
    const double t3 = t2 * t;
    return {minimum_jerk(t), t + t3 * (-6.0 + t * (8.0 - 3.0 * t)),
            0.5 * t2 + t3 * (-1.5 + t * (1.5 - 0.5 * t))};
  }
  /// Of its first derivative by the share.
  static constexpr QuinticWeights slope(double t) noexcept {
    const double t2 = t * t;
    return {t2 * (30.0 + t * (-60.0 + 30.0 * t)), 1.0 + t2 * (-18.0 + t * (32.0 - 15.0 * t)),
            t + t2 * (-4.5 + t * (6.0 - 2.5 * t))};
  }
  /// Of its second derivative by the share.
  static constexpr QuinticWeights curvature(double t) noexcept {
    return {t * (60.0 + t * (-180.0 + 120.0 * t)), t * (-36.0 + t * (96.0 - 60.0 * t)),
            1.0 + t * (-9.0 + t * (18.0 - 10.0 * t))};
  }
};

/// The quintic from a moment to rest at a distance, in n iterations.
struct Quintic {
  double distance = 0.0;
  double velocity = 0.0;      // at the start, for each share of the time
  double acceleration = 0.0;  // at the start, for each share of the time squared

  static Quintic from(double distance, const Moment& start, double n) noexcept {
    return {distance, start.velocity * n, start.acceleration * n * n};
  }
  double at(const QuinticWeights& weights) const noexcept {
    return distance * weights.distance + velocity * weights.velocity +
           acceleration * weights.acceleration;
  }
};

/// Highest speed of a quintic [1/share of the time].
double peak_speed(const Quintic& quintic) noexcept;

/// Iterations of a linear motion at `speed` [1/iteration], rounded up, at least 1.
std::int64_t linear_iterations(double distance, double speed) noexcept;

/// Fewest iterations of a minimum-jerk motion whose peak does not exceed `speed` [1/iteration];
/// a motion that starts faster may not become faster still. The search is bounded: where no number
/// of iterations it tries will do (a strong initial acceleration), it takes the one with the
/// lowest peak.
std::int64_t minimum_jerk_iterations(double distance, const Moment& start, double speed) noexcept;

}  // namespace o80
