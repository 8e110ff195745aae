#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "control/motion/number_plan.hpp"
#include "control/motion/velocity_change.hpp"

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
  double minimum() const noexcept { return bounds_.low; }
  double maximum() const noexcept { return bounds_.high; }
  /// False outside minimum and maximum.
  bool admits(double position) const noexcept {
    return !(position < bounds_.low || position > bounds_.high);
  }
  double position() const noexcept { return now_.position; }
  const Moment& moment() const noexcept { return now_; }
  /// True if braking would change nothing.
  bool at_rest() const noexcept { return now_.speed == 0.0 && now_.acceleration == 0.0; }
  /// True if braking would not move it: it may stop at once.
  bool stays() const noexcept {
    if (!std::isfinite(rates_.acceleration)) return true;
    const double tolerance = slack();
    return std::abs(now_.speed) <= rates_.acceleration + tolerance &&
           std::abs(now_.speed) <= rates_.jerk + tolerance &&
           std::abs(now_.speed + now_.acceleration) <= rates_.jerk + tolerance;
  }
  /// The shortest stop from here.
  VelocityChange stop() noexcept {
    const bool has_begun = stop_known_ && stopped_ > 0;
    if (has_begun || !std::isfinite(rates_.jerk)) return stop_from_here();
    know_stop();
    return stop_;
  }
  /// Positions that it visits.
  Span stopping_span() noexcept {
    Span visited{now_.position, now_.position};
    if (stays()) return visited;
    const VelocityChange stop = this->stop();
    visited.include(now_.position + stop.run_before_turn(now_.speed));
    visited.include(now_.position + stop.displacement());
    return visited;
  }
  /// True if these lie between minimum and maximum.
  bool stops_inside() noexcept {
    const Span visited = stopping_span();
    return visited.low >= bounds_.low - rounding() && visited.high <= bounds_.high + rounding();
  }

  /// Sets the position, at rest; it may be outside the bounds.
  void restart(double position) noexcept {
    now_.position = position;
    begin(bounds_);
    rest();
  }
  /// It does not move any more.
  void rest() noexcept {
    now_.speed = now_.acceleration = 0.0;
    stop_known_ = false;
  }
  /// A motion begins here. Whatever it follows, it stays inside the bounds and inside `span`.
  void begin(const Span& span) noexcept {
    wanted_ = now_.position;
    scale_ = std::abs(now_.position);
    reach(span);
  }
  /// The plan that it follows changes: stays inside the bounds and inside `span`.
  void reach(const Span& span) noexcept {
    span_ = {std::max(bounds_.low, span.low), std::min(bounds_.high, span.high)};
  }
  /// The same, inside the bounds only.
  void begin() noexcept { begin(bounds_); }
  /// From now on it stays inside the bounds only.
  void follow_within_bounds() noexcept { span_ = bounds_; }
  /// What it follows reaches further than begin() knew.
  void widen(double position) noexcept {
    span_ = {std::max(bounds_.low, std::min(span_.low, position)),
             std::min(bounds_.high, std::max(span_.high, position))};
  }

  /// One iteration of a plan: to `next`, if all limits and bounds allow it but for rounding; else
  /// false, and nothing changes.
  [[gnu::always_inline]] bool pass(double next) noexcept {
    scale_ = std::max(scale_, std::abs(next));
    const double speed = next - now_.position;
    const double acceleration = speed - now_.speed;
    const double room = rounding();
    // one branch for all limits: which of them rounding exceeds cannot be predicted
    const auto within = [room](double value, double limit) -> unsigned {
      return std::abs(value) <= limit * (1.0 + kLimitRounding) + room ? 1 : 0;
    };
    const unsigned keeps_rates = within(speed, rates_.speed) &
                                 within(acceleration, rates_.acceleration) &
                                 within(acceleration - now_.acceleration, rates_.jerk);
    Span allowed = bounds_;
    allowed.include(now_.position);
    const bool keeps =
        (keeps_rates || !has_rates_) && next <= allowed.high + room && next >= allowed.low - room;
    if (keeps) accept(std::clamp(next, allowed.low, allowed.high));
    return keeps;
  }
  /// One iteration to `next`, whatever the limits say.
  void accept(double next) noexcept {
    now_ = moved(next, next - now_.position);
    wanted_ = next;
    stop_known_ = false;
  }
  /// One iteration towards `wanted`; returns the limit that kept it from there.
  Limit follow(double wanted) noexcept {
    const double step = wanted - wanted_;
    const double lag = now_.position - wanted_;
    wanted_ = wanted;
    const double speed = wanted - now_.position;
    if (!has_rates_ && wanted >= span_.low && wanted <= span_.high && std::isfinite(speed)) {
      // what follow_without_jerk() does inside the bounds, if there are no other limits
      scale_ = std::max(scale_, std::abs(inside(now_.position + speed, now_.position)));
      now_ = moved(wanted, speed);
      forget_rounding();
      return Limit::none;
    }
    return std::isfinite(rates_.jerk) ? follow_with_jerk(step, lag)
                                      : follow_without_jerk(step, lag);
  }
  /// One iteration of braking, as fast as the limits allow.
  void brake() noexcept {
    if (!std::isfinite(rates_.acceleration)) {
      rest();
    } else if (stays()) {
      now_ = {now_.position, 0.0, -now_.speed};
      stop_known_ = false;
    } else {
      slow_down();
    }
    wanted_ = now_.position;
  }

  /// For a motion that something else keeps: it is here now, wherever the last iteration led.
  void place(const Moment& now) noexcept {
    now_ = now;
    wanted_ = now.position;
    scale_ = std::abs(now.position);
    stop_known_ = false;
  }
  /// Then one iteration at the speed nearest to `wanted` from which it stops inside the bounds;
  /// returns the bound that kept it from `wanted`.
  Limit nearest_speed(double wanted) noexcept;

 private:
  // rounding of the interpolation does not exceed a limit
  static constexpr double kLimitRounding = 1e-9;

  /// A possible next state and its shortest stop.
  struct Candidate {
    Moment moment;
    VelocityChange stop;
  };

  Limit follow_without_jerk(double step, double lag) noexcept;
  Limit follow_with_jerk(double step, double lag) noexcept;
  Limit accelerate(double wanted) noexcept;
  Candidate candidate(double acceleration) const noexcept {
    const double speed = now_.speed + acceleration;
    return {{now_.position + speed, speed, acceleration},
            VelocityChange(-speed, acceleration, rates_)};
  }
  Limit violated(const Candidate& next) const noexcept;
  double goal(double step, double lag, const Span& accelerations) const noexcept;
  void accept(const Candidate& next) noexcept {
    move(next.moment.speed);
    now_.acceleration = next.moment.acceleration;
    know_stop(next.stop);
  }
  /// Here after an iteration at this speed; a jump beyond the range of a double is no speed.
  Moment moved(double position, double speed) const noexcept {
    const double acceleration = speed - now_.speed;
    return std::isfinite(acceleration) ? Moment{position, speed, acceleration} : Moment{position};
  }
  void move(double speed) noexcept {
    now_ = moved(inside(now_.position + speed, now_.position), speed);
    scale_ = std::max(scale_, std::abs(now_.position));
  }
  /// The shortest stop from the present state.
  void know_stop(const VelocityChange& stop) noexcept {
    stop_ = stop;
    stopped_ = 0;
    stop_known_ = true;
  }
  void know_stop() noexcept {
    if (!stop_known_) know_stop(stop_from_here());
  }
  VelocityChange stop_from_here() const noexcept {
    return {-now_.speed, now_.acceleration, rates_};
  }
  void slow_down() noexcept;
  /// Treats a speed within rounding as 0.
  void forget_rounding() noexcept {
    const double nothing = slack() / 100.0 + 2.0 * rounding();
    const bool steady = !std::isfinite(rates_.jerk) || std::abs(now_.acceleration) <= nothing;
    if (steady && std::abs(now_.speed) <= nothing) rest();
  }
  Span speeds() const noexcept;
  /// The next accelerations that the limits of acceleration and jerk allow.
  Span accelerations() const noexcept {
    return {std::max(now_.acceleration - rates_.jerk, -rates_.acceleration),
            std::min(now_.acceleration + rates_.jerk, rates_.acceleration)};
  }
  /// Within the span, or no further outside than `before`.
  double inside(double position, double before) const noexcept {
    return std::clamp(position, std::min(span_.low, before), std::max(span_.high, before));
  }
  /// Rounding of the sums of a motion.
  double rounding() const noexcept {
    return 8.0 * std::numeric_limits<double>::epsilon() *
           std::max({scale_, std::abs(now_.position), std::abs(wanted_)});
  }
  double slack() const noexcept { return rounding() + tolerance_; }

  Span bounds_;
  Span span_;  // the bounds while it follows: also those of what it follows
  Rates rates_;
  bool has_rates_;
  double tolerance_;  // of the finest rate
  Moment now_;
  double wanted_ = 0.0;       // position wanted last
  double scale_ = 0.0;        // largest |position| since the motion began
  bool stop_known_ = true;    // `stop_` begins at the present state
  VelocityChange stop_;       // with a jerk limit: the stop from the last accepted state
  std::int64_t stopped_ = 0;  // iterations of `stop_` that are done
};

}  // namespace o80
