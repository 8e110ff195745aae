#pragma once

#include <cstdint>

#include "control/motion/velocity_change.hpp"

namespace o80 {

/// The minimum-jerk motion of one number to rest at a target in n iterations: the polynomial of
/// degree 5 through the last three positions (iterations -2, -1, 0) and, in the iterations n, n + 1
/// and n + 2, the target. Of all motions in n iterations from there to rest it has the least sum of
/// squared third differences.
///
/// Realtime: yes, bounded time.
class SmoothMotion {
 public:
  SmoothMotion() = default;
  SmoothMotion(const Moment& start, double target, std::int64_t iterations) noexcept;

  /// The position in iteration i, 1 to n.
  double position(double i) const noexcept {
    const double left = last_ - i;
    return target_ - left * (left + 1.0) * (left + 2.0) * (c0_ + i * (c1_ + (i + 1.0) * c2_));
  }

  /// Largest values from the first iteration to rest.
  struct Extremes {
    Span positions;
    Span speeds;
    double acceleration;  // size
    double jerk;
  };
  Extremes extremes() const noexcept;

 private:
  double last_ = 0.0;  // n
  double target_ = 0.0;
  // position = target + (i - n)(i - n - 1)(i - n - 2) (c0 + c1 i + c2 i (i + 1))
  double c0_ = 0.0;
  double c1_ = 0.0;
  double c2_ = 0.0;
};

}  // namespace o80
