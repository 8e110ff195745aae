#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "control/motion/visit_block.hpp"

namespace o80 {

/// Limits of one number per iteration, for positions p(i). Infinity: no limit.
struct Rates {
  double speed;         // limit of v(i) = p(i) - p(i-1)
  double acceleration;  // limit of a(i) = v(i) - v(i-1)
  double jerk;          // limit of a(i) - a(i-1)
};

/// Position of one number and its differences: v(i) = p(i) - p(i-1), a(i) = v(i) - v(i-1).
struct Moment {
  double position = 0.0;
  double speed = 0.0;
  double acceleration = 0.0;
};

/// Values from `low` to `high`: positions, speeds or accelerations.
struct Span {
  double low = 0.0;
  double high = 0.0;
  void include(double position) noexcept {
    low = std::min(low, position);
    high = std::max(high, position);
  }
};

/// The shortest change of a speed by `change` that ends with acceleration 0, in whole iterations.
///
/// The plan is a sequence of accelerations a(1) ... a(steps) with a(steps) = 0 (with a jerk limit),
/// |a(i)| <= acceleration, |a(i) - a(i-1)| <= jerk, and the sum `change`. It is a trapezoid: from
/// a(0) down to a trough and up to 0, or the mirror image of that (a crest).
///
/// The shortest trapezoid with whole steps changes the speed by more than `change`, the next
/// shorter one by less. The plan is their mean with the weights 1 - share_ and share_. It keeps the
/// limits because these are convex.
///
/// Realtime: yes. Construction and all functions take a bounded time.
class VelocityChange {
 public:
  VelocityChange() = default;
  /// `acceleration`: the present one, a(0), within its limit.
  VelocityChange(double change, double acceleration, const Rates& rates) noexcept
      : start_(acceleration), acceleration_(rates.acceleration), jerk_(rates.jerk) {
    O80_COUNT(speed_change);
    if (std::isfinite(jerk_)) {
      plan_with_jerk(change);
    } else {
      plan_without_jerk(change);
    }
  }

  /// Iterations until the change is done; 0 if there is nothing to do.
  std::int64_t steps() const noexcept { return steps_; }
  /// The same time, not rounded up to whole iterations.
  double time() const noexcept { return static_cast<double>(steps_) - (crest_ ? 0.0 : share_); }
  /// The acceleration of iteration i, 1 to `steps()`; 0 after.
  double acceleration(std::int64_t i) const noexcept;
  /// Displacement within steps() minus that of the final speed: the sum of v(i) - v(steps).
  double displacement() const noexcept { return displacement_; }
  /// Derivatives of displacement() and time() with respect to the change: both are piecewise linear
  /// in it.
  double slope() const noexcept { return slope_; }
  double time_slope() const noexcept { return crest_ ? 0.0 : -share_slope_; }
  /// Changes the speed by `more`, too, if that is a mean of the same two trapezoids; else false.
  bool extend(double more) noexcept {
    const double share = share_ + more * share_slope_;
    if (share_slope_ == 0.0 || !(share >= 0.0 && share < kMostShare)) return false;
    share_ = share;
    displacement_ += more * slope_;
    return true;
  }
  /// Largest change of the speed away from its target, in the direction of the present
  /// acceleration, signed; 0 if there is none.
  double detour() const noexcept { return detour_; }
  /// For a start at `speed`: displacement until the speed changes its sign for the first time, if
  /// the detour() takes it through zero; else 0.
  double run_before_turn(double speed) const noexcept;

 private:
  static constexpr double kMostShare = 1.0 - 1e-9;  // then an iteration less is enough

  struct Sums {
    double change = 0.0;  // sum of a(i)
    double moment = 0.0;  // sum of (i - 1) a(i)
  };

  void plan_without_jerk(double change) noexcept;
  void plan_with_jerk(double change) noexcept;
  /// Acceleration of iteration i on the deepest trapezoid from `start` to 0 in so many steps.
  double trough(double start, double i, double steps) const noexcept {
    return i >= steps ? 0.0 : std::max({-acceleration_, start - i * jerk_, -(steps - i) * jerk_});
  }
  /// Of limits and a(0), which all trapezoids share, in iterations.
  struct Ratios {
    double start;    // a(0) / jerk
    double deepest;  // whole iterations from a(0) to the limit of acceleration
    double most;     // acceleration / jerk
  };
  Sums sums(const Ratios& ratios, double steps) const noexcept;
  /// The mean of two ways that changes the speed by `change`; all are mirrored.
  void mean(double change, const Sums& own, const Sums& other) noexcept;

  // mirrored by sign_, so that the trough is negative
  double sign_ = 1.0;
  double start_ = 0.0;  // a(0)
  double acceleration_ = 0.0;
  double jerk_ = 0.0;
  std::int64_t steps_ = 0;
  std::int64_t shorter_ = 0;  // steps of the other trapezoid
  bool crest_ = false;        // the other one is the crest with as many steps
  double share_ = 0.0;        // weight of the other one
  double displacement_ = 0.0;
  double slope_ = 0.0;
  double share_slope_ = 0.0;  // derivative of share_
  double detour_ = 0.0;
};

}  // namespace o80
