#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "control/velocity_change.hpp"

namespace o80 {

/// Which limit gave a number less than was wanted.
enum class Limit : std::uint8_t { none, minimum, maximum, speed, acceleration, jerk };

/// Keeps one number within its limits, whatever it is asked to follow.
///
/// It keeps position, speed and acceleration of its own, in iterations. It admits only states from
/// which it can stop inside minimum and maximum, so there is always a next one. A position outside
/// the bounds may stay or move inward, never outward. What it follows and has lost it catches up
/// with as fast as the limits allow, without overshoot.
///
/// Realtime: yes, bounded time.
class NumberLimiter {
 public:
  NumberLimiter(double minimum, double maximum, const Rates& rates) noexcept
      : minimum_(minimum), maximum_(maximum), rates_(rates) {}

  const Rates& rates() const noexcept { return rates_; }
  double minimum() const noexcept { return minimum_; }
  double maximum() const noexcept { return maximum_; }
  double position() const noexcept { return position_; }
  double speed() const noexcept { return speed_; }
  double acceleration() const noexcept { return acceleration_; }
  /// Without an acceleration limit it rests whenever nothing moves it.
  bool at_rest() const noexcept {
    return (speed_ == 0.0 && acceleration_ == 0.0) || !std::isfinite(rates_.acceleration);
  }
  /// It is where it was asked to be.
  bool tracks() const noexcept { return position_ == wanted_; }

  /// At rest, there; also outside the bounds.
  void restart(double position) noexcept;
  /// A motion begins that starts where the number is now.
  void begin() noexcept {
    wanted_ = position_;
    scale_ = std::abs(position_);
  }

  /// One iteration towards `wanted`; says what held it back. It catches up no faster than `most`,
  /// or than it was.
  Limit follow(double wanted, double most = std::numeric_limits<double>::infinity()) noexcept;
  /// One iteration towards rest, as fast as the limits allow.
  void brake() noexcept;

 private:
  struct Candidate;

  Limit follow_with_acceleration(double step, double lag, double most) noexcept;
  Limit follow_with_jerk(double step, double lag, double most) noexcept;
  Candidate candidate(double acceleration) const noexcept;
  Limit violated(const Candidate& next, double most) const noexcept;
  double goal(double step, double lag, double low, double high) const noexcept;
  void accept(const Candidate& next) noexcept;
  void move(double speed) noexcept;
  void slow_down() noexcept;
  void forget_rounding() noexcept;
  double inside(double position, double before) const noexcept;
  double rounding() const noexcept;
  double slack() const noexcept;

  double minimum_;
  double maximum_;
  Rates rates_;
  double position_ = 0.0;
  double speed_ = 0.0;
  double acceleration_ = 0.0;
  double wanted_ = 0.0;       // what it was asked for last
  double scale_ = 0.0;        // how far from 0 it was since the motion began
  VelocityChange stop_;       // with a jerk limit: how it can stop from here
  std::int64_t stopped_ = 0;  // iterations of that which are done
  double peak_ = 0.0;         // the highest speed on that way
};

}  // namespace o80
