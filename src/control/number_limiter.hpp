#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "control/velocity_change.hpp"

namespace o80 {

/// The limit that kept a number from its wanted position.
enum class Limit : std::uint8_t { none, minimum, maximum, speed, acceleration, jerk };

/// Keeps one number within its limits while it follows a wanted position.
///
/// It keeps position, speed and acceleration, per iteration. It admits only states from which it
/// can stop between minimum and maximum, so a next state always exists. A position outside the
/// bounds may stay or move inward, never outward. If it lags behind, it catches up as fast as the
/// limits allow, without overshoot.
///
/// Realtime: yes, bounded time.
class NumberLimiter {
 public:
  NumberLimiter(double minimum, double maximum, const Rates& rates) noexcept
      : minimum_(minimum),
        maximum_(maximum),
        rates_(rates),
        unlimited_(minimum <= -kHuge && maximum >= kHuge && !std::isfinite(rates.speed) &&
                   !std::isfinite(rates.acceleration) && !std::isfinite(rates.jerk)),
        tolerance_(tolerance_of(rates)) {}

  const Rates& rates() const noexcept { return rates_; }
  double minimum() const noexcept { return minimum_; }
  double maximum() const noexcept { return maximum_; }
  double position() const noexcept { return position_; }
  double speed() const noexcept { return speed_; }
  double acceleration() const noexcept { return acceleration_; }
  /// True if braking would not move it. Without an acceleration limit it stops at once.
  bool at_rest() const noexcept {
    return (speed_ == 0.0 && acceleration_ == 0.0) || !std::isfinite(rates_.acceleration);
  }
  /// True if it is at the position wanted last.
  bool tracks() const noexcept { return position_ == wanted_; }

  /// Sets the position, at rest; it may be outside the bounds.
  void restart(double position) noexcept;
  /// A motion begins at the present position.
  void begin() noexcept {
    wanted_ = position_;
    scale_ = std::abs(position_);
  }

  /// One iteration towards `wanted`; returns the limit that kept it from there. It catches up at
  /// most at `most`, or at its present speed if that is higher.
  Limit follow(double wanted, double most = std::numeric_limits<double>::infinity()) noexcept {
    const double step = wanted - wanted_;
    const double lag = position_ - wanted_;
    wanted_ = wanted;
    if (unlimited_ && std::abs(wanted) < kHuge && std::abs(position_) < kHuge) {
      return follow_freely();
    }
    if (!std::isfinite(rates_.acceleration) && !std::isfinite(rates_.jerk)) return follow_at_once();
    return std::isfinite(rates_.jerk) ? follow_with_jerk(step, lag, most)
                                      : follow_with_acceleration(step, lag, most);
  }
  /// One iteration of braking, as fast as the limits allow.
  void brake() noexcept;

 private:
  struct Candidate;

  // two numbers below it are not too far apart for a double
  static constexpr double kHuge = 0.25 * std::numeric_limits<double>::max();

  /// What follow_at_once() does with a number that has a rest value only.
  Limit follow_freely() noexcept {
    const double speed = wanted_ - position_;
    scale_ = std::max(scale_, std::abs(position_ + speed));
    position_ = wanted_;
    acceleration_ = speed - speed_;
    speed_ = speed;
    if (std::abs(speed_) <= slack() / 100.0 + 2.0 * rounding()) speed_ = acceleration_ = 0.0;
    return Limit::none;
  }
  Limit follow_at_once() noexcept;
  Limit follow_with_acceleration(double step, double lag, double most) noexcept;
  Limit follow_with_jerk(double step, double lag, double most) noexcept;
  Candidate candidate(double acceleration) const noexcept;
  Limit violated(const Candidate& next, double most) const noexcept;
  double goal(double step, double lag, double low, double high) const noexcept;
  void accept(const Candidate& next) noexcept;
  void move(double speed) noexcept;
  void slow_down() noexcept;
  void forget_rounding() noexcept;
  static double tolerance_of(const Rates& rates) noexcept;
  double inside(double position, double before) const noexcept;
  /// Rounding of the sums of a motion.
  double rounding() const noexcept {
    return 8.0 * std::numeric_limits<double>::epsilon() *
           std::max({scale_, std::abs(position_), std::abs(wanted_)});
  }
  double slack() const noexcept { return rounding() + tolerance_; }

  double minimum_;
  double maximum_;
  Rates rates_;
  bool unlimited_;    // within the range of its kind
  double tolerance_;  // of the finest rate
  double position_ = 0.0;
  double speed_ = 0.0;
  double acceleration_ = 0.0;
  double wanted_ = 0.0;       // position wanted last
  double scale_ = 0.0;        // largest |position| since the motion began
  VelocityChange stop_;       // with a jerk limit: the stop from the last accepted state
  std::int64_t stopped_ = 0;  // iterations of `stop_` that are done
  double peak_ = 0.0;         // highest speed of `stop_`
};

}  // namespace o80
