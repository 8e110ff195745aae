#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "control/number_plan.hpp"
#include "control/velocity_change.hpp"

namespace o80 {

/// Keeps one number within its limits.
///
/// It keeps position, speed and acceleration, per iteration. A planned position passes unchanged if
/// it keeps all limits. A wanted position that is not planned is followed: as fast as the limits
/// allow, without overshoot, and only through states from which it can stop between minimum and
/// maximum and inside the span of what it follows, so a next state always exists. A position
/// outside the bounds may stay or move inward, never outward.
///
/// Realtime: yes, bounded time.
class NumberLimiter {
 public:
  NumberLimiter(double minimum, double maximum, const Rates& rates) noexcept;

  const Rates& rates() const noexcept { return rates_; }
  double minimum() const noexcept { return minimum_; }
  double maximum() const noexcept { return maximum_; }
  /// False outside minimum and maximum.
  bool admits(double position) const noexcept {
    return !(position < minimum_ || position > maximum_);
  }
  double position() const noexcept { return position_; }
  Moment moment() const noexcept { return {position_, speed_, acceleration_}; }
  /// True if braking would change nothing.
  bool at_rest() const noexcept { return speed_ == 0.0 && acceleration_ == 0.0; }
  /// True if braking would not move it: it may stop at once.
  bool stays() const noexcept;
  /// Positions that the shortest stop visits.
  Span stop() const noexcept;
  /// True if these lie between minimum and maximum.
  bool stops_inside() const noexcept;

  /// Sets the position, at rest; it may be outside the bounds.
  void restart(double position) noexcept;
  /// It does not move any more.
  void rest() noexcept {
    speed_ = acceleration_ = 0.0;
    stop_known_ = false;
  }
  /// A motion begins at the present position. Whatever it follows, it stays inside `span`.
  void begin(const Span& span) noexcept;
  /// The same, inside the bounds only.
  void begin() noexcept { begin({minimum_, maximum_}); }
  /// From now on it stays inside the bounds only.
  void follow_within_bounds() noexcept {
    low_ = minimum_;
    high_ = maximum_;
  }
  /// What it follows reaches further than begin() knew.
  void widen(double position) noexcept {
    low_ = std::max(minimum_, std::min(low_, position));
    high_ = std::min(maximum_, std::max(high_, position));
  }

  /// One iteration of a plan: to `next`, if all limits allow it; else false, and nothing changes.
  bool pass(double next) noexcept {
    const double speed = next - position_;
    const double acceleration = speed - speed_;
    const bool keeps = next <= maximum_ && next >= minimum_ && std::abs(speed) <= rates_.speed &&
                       std::abs(acceleration) <= rates_.acceleration &&
                       std::abs(acceleration - acceleration_) <= rates_.jerk;
    scale_ = std::max(scale_, std::abs(next));
    if (!keeps) return pass_rounded(next);
    accept(next);
    return true;
  }
  /// One iteration to `next`, whatever the limits say.
  void accept(double next) noexcept {
    const double speed = next - position_;
    acceleration_ = speed - speed_;
    speed_ = speed;
    position_ = wanted_ = next;
    stop_known_ = false;
  }
  /// One iteration towards `wanted`; returns the limit that kept it from there.
  Limit follow(double wanted) noexcept {
    const double step = wanted - wanted_;
    const double lag = position_ - wanted_;
    wanted_ = wanted;
    if (unlimited_ && std::abs(wanted) < kHuge && std::abs(position_) < kHuge) {
      return follow_freely();
    }
    return std::isfinite(rates_.jerk) ? follow_with_jerk(step, lag)
                                      : follow_without_jerk(step, lag);
  }
  /// One iteration of braking, as fast as the limits allow.
  void brake() noexcept;

  /// For a motion that something else keeps: it is here now, wherever the last iteration led.
  void place(const Moment& now) noexcept;
  /// Then one iteration at the speed nearest to `wanted` from which it stops inside the bounds;
  /// returns the bound that kept it from `wanted`.
  Limit nearest_speed(double wanted) noexcept;

 private:
  struct Candidate;

  // two numbers below it are not too far apart for a double
  static constexpr double kHuge = 0.25 * std::numeric_limits<double>::max();

  /// What follow_without_jerk() does with a number that has a rest value only.
  Limit follow_freely() noexcept {
    const double speed = wanted_ - position_;
    scale_ = std::max(scale_, std::abs(position_ + speed));
    position_ = wanted_;
    acceleration_ = speed - speed_;
    speed_ = speed;
    if (std::abs(speed_) <= slack() / 100.0 + 2.0 * rounding()) speed_ = acceleration_ = 0.0;
    return Limit::none;
  }
  bool pass_rounded(double next) noexcept;
  Limit follow_without_jerk(double step, double lag) noexcept;
  Limit follow_with_jerk(double step, double lag) noexcept;
  Limit accelerate(double wanted) noexcept;
  Candidate candidate(double acceleration) const noexcept;
  Limit violated(const Candidate& next) const noexcept;
  double goal(double step, double lag, double low, double high) const noexcept;
  void accept(const Candidate& next) noexcept;
  void move(double speed) noexcept;
  void know_stop() noexcept;
  void slow_down() noexcept;
  void stand() noexcept;
  void forget_rounding() noexcept;
  Span speeds() const noexcept;
  Span accelerations() const noexcept;
  double inside(double position, double before) const noexcept;
  /// Rounding of the sums of a motion.
  double rounding() const noexcept {
    return 8.0 * std::numeric_limits<double>::epsilon() *
           std::max({scale_, std::abs(position_), std::abs(wanted_)});
  }
  double slack() const noexcept { return rounding() + tolerance_; }

  double minimum_;
  double maximum_;
  double low_;  // the bounds while it follows: also those of what it follows
  double high_;
  Rates rates_;
  bool unlimited_;    // within the range of its kind
  double tolerance_;  // of the finest rate
  double position_ = 0.0;
  double speed_ = 0.0;
  double acceleration_ = 0.0;
  double wanted_ = 0.0;       // position wanted last
  double scale_ = 0.0;        // largest |position| since the motion began
  bool stop_known_ = true;    // `stop_` begins at the present state
  VelocityChange stop_;       // with a jerk limit: the stop from the last accepted state
  std::int64_t stopped_ = 0;  // iterations of `stop_` that are done
};

}  // namespace o80
