#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "control/motion/number_limiter.hpp"
#include "o80/describe/rows.hpp"

namespace o80 {

/// Keeps what a number moves between bounds: the position that is moved by a commanded velocity.
///
/// It is a limiter one level up. Its place is where the observed position will be when the robot
/// has reacted, its speed and acceleration are those of the commanded velocity, and the limits of
/// the velocity's speed and acceleration limit its acceleration and jerk.
///
/// Realtime: yes.
class IntegralBound {
 public:
  IntegralBound(const IntegralRow& row, const Rates& rates, double period) noexcept
      : number_(row.number),
        period_(period),
        reaction_(row.reaction),
        guard_(row.minimum, row.maximum,
               {std::numeric_limits<double>::infinity(), rates.speed * period,
                rates.acceleration * period}),
        moving_(guard_) {}

  /// The number, in the observed state, that is moved.
  std::uint32_t number() const noexcept { return number_; }
  void observe(double position) noexcept {
    if (std::isfinite(position)) observed_ = position;
  }

  /// The limiter of the velocity, before its next iteration.
  void note(const NumberLimiter& moving) noexcept { moving_ = moving; }
  const NumberLimiter& noted() const noexcept { return moving_; }

  /// Which bound, if any, the velocity `wanted` would pass, and the nearest one that passes none.
  struct Admitted {
    Limit bound;
    double velocity;
  };
  Admitted admit(double wanted) noexcept {
    if (!std::isfinite(guard_.rates().acceleration)) {
      // so slow that a robot with this reaction, a delay or a lag, does not overshoot
      const double time = period_ + 4.0 * reaction_;
      const double highest = std::max(0.0, (guard_.maximum() - observed_) / time);
      const double lowest = std::min(0.0, (guard_.minimum() - observed_) / time);
      is_blocked_ = (wanted > 0.0 ? highest : -lowest) <= kBlocked * std::abs(wanted);
      if (wanted > highest) return {Limit::above_integral, highest};
      return wanted < lowest ? Admitted{Limit::below_integral, lowest}
                             : Admitted{Limit::none, wanted};
    }
    const Moment& now = moving_.moment();
    // while the velocity changes, a robot is late by half of the change in its reaction
    const double change = now.speed / period_ * reaction_ / 2.0;
    const double ahead = now.position * period_ + (now.position - change) * reaction_;
    guard_.place({observed_ + ahead, now.position * period_, now.speed * period_});
    const Limit bound = guard_.nearest_speed(wanted * period_);
    is_blocked_ = guard_.stays();
    if (bound == Limit::none) return {Limit::none, wanted};
    return {bound == Limit::maximum ? Limit::above_integral : Limit::below_integral,
            guard_.moment().speed / period_};
  }
  /// After admit(): the velocity may become 0 at once.
  bool is_blocked() const noexcept { return is_blocked_; }

 private:
  // without a limit of acceleration: less than this share of what is wanted is no motion
  static constexpr double kBlocked = 0.01;

  std::uint32_t number_;
  double period_;    // [s]
  double reaction_;  // [s]
  NumberLimiter guard_;
  NumberLimiter moving_;
  double observed_ = 0.0;
  bool is_blocked_ = false;
};

}  // namespace o80
