#include "control/motion/number_limiter.hpp"

#include "base/whole.hpp"

namespace o80 {
namespace {

constexpr int kHalvings = 16;

/// The highest speed from which a number stops within the distance `room`, if it slows down by
/// `acceleration` in each iteration. The iteration at that speed is included.
double speed_for(double room, double acceleration) noexcept {
  if (room <= 0.0) return 0.0;
  if (!std::isfinite(room)) return room;
  const double k = whole_below((std::sqrt(1.0 + 8.0 * room / acceleration) - 1.0) / 2.0);
  return (room + acceleration * k * (k + 1.0) / 2.0) / (k + 1.0);
}

}  // namespace

NumberLimiter::NumberLimiter(double minimum, double maximum, const Rates& rates) noexcept
    : bounds_{minimum, maximum},
      span_(bounds_),
      rates_(rates),
      has_rates_(std::isfinite(rates.speed) || std::isfinite(rates.acceleration) ||
                 std::isfinite(rates.jerk)) {
  const double finest = std::min({rates.speed, rates.acceleration, rates.jerk});
  tolerance_ = std::isfinite(finest) ? kLimitRounding * finest : 0.0;
}

/// The speeds from which it stops inside its bounds, in both directions.
Span NumberLimiter::speeds() const noexcept {
  const Span room{-std::max(0.0, now_.position - span_.low),
                  std::max(0.0, span_.high - now_.position)};
  if (!std::isfinite(rates_.acceleration)) return room;
  return {-speed_for(-room.low, rates_.acceleration), speed_for(room.high, rates_.acceleration)};
}

Limit NumberLimiter::follow_without_jerk(double step, double lag) noexcept {
  // the wanted speed: reach the wanted position, or, from farther away, approach it at the highest
  // speed from which it can stop there
  const double before = now_.position;
  double speed = wanted_ - before;
  bool within_reach = true;
  if (std::isfinite(rates_.acceleration)) {
    const double closing = speed_for(std::abs(lag), rates_.acceleration);
    within_reach = closing >= std::abs(lag);
    if (!within_reach) speed = step - std::copysign(closing, lag);
  }

  // the allowed speeds
  const Span stopping = speeds();
  const double highest =
      std::min(std::min(now_.speed + rates_.acceleration, rates_.speed), stopping.high);
  const double lowest =
      std::max(std::max(now_.speed - rates_.acceleration, -rates_.speed), stopping.low);
  const bool is_inside = speed <= highest && speed >= lowest;  // mostly, so no slack is needed
  if (is_inside || (speed <= highest + slack() && speed >= lowest - slack())) {
    move(speed);
    if (within_reach) {
      now_.position = inside(wanted_, before);
      forget_rounding();
    }
    return now_.position == wanted_ ? Limit::none : Limit::acceleration;
  }
  const bool upward = speed > highest;
  const double bound = upward ? highest : lowest;
  move(upward ? std::max(highest, lowest) : std::min(highest, lowest));
  if (upward && bound == stopping.high) return Limit::maximum;
  if (!upward && bound == stopping.low) return Limit::minimum;
  return std::abs(bound) == rates_.speed ? Limit::speed : Limit::acceleration;
}

/// The limit that a candidate or its stop violates.
Limit NumberLimiter::violated(const Candidate& next) const noexcept {
  const auto [position, speed, acceleration] = next.moment;
  const double fastest = std::max(std::abs(speed), std::abs(speed + next.stop.detour()));
  if (fastest > rates_.speed + slack()) return Limit::speed;
  const double end = position + next.stop.displacement();
  const double turn = position + next.stop.run_before_turn(speed);
  const double rounding = this->rounding();
  // `side`: 1 above, -1 below. Outside the bounds it must not turn outward again
  const auto leaves = [&](double side, double bound) {
    const double next_to = side * position;
    const double inner = std::max(bound, std::min(next_to, side * turn));
    return next_to > std::max(bound, side * now_.position) + rounding ||
           std::max(side * end, side * turn) > std::max(inner, next_to) + rounding ||
           (side * end > side * turn && side * end > inner + rounding);
  };
  if (leaves(1.0, span_.high)) return Limit::maximum;
  return leaves(-1.0, -span_.low) ? Limit::minimum : Limit::none;
}

/// The acceleration that approaches the wanted position as fast as possible without overshoot,
/// computed in the frame that moves with the wanted position (by `step` in each iteration).
double NumberLimiter::goal(double step, double lag, const Span& accelerations) const noexcept {
  auto [low, high] = accelerations;
  const auto overshoot = [&](double acceleration) {
    const double speed = now_.speed + acceleration - step;
    return lag + speed + VelocityChange(-speed, acceleration, rates_).displacement();
  };
  if (overshoot(low) >= 0.0) return low;
  if (overshoot(high) <= 0.0) return high;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = low + (high - low) / 2.0;
    (overshoot(middle) > 0.0 ? high : low) = middle;
  }
  return low;
}

Limit NumberLimiter::follow_with_jerk(double step, double lag) noexcept {
  const double tolerance = slack();
  const Span allowed = accelerations();

  // reach the wanted position exactly, if it can stay there
  const double wanted = wanted_ - now_.position - now_.speed;
  const double relative = wanted_ - now_.position - step;
  const bool tracked = lag == 0.0;
  const bool stays =
      tracked || (std::abs(relative) <= rates_.jerk && std::abs(relative + wanted) <= rates_.jerk);
  if (stays && wanted >= allowed.low - tolerance && wanted <= allowed.high + tolerance) {
    const Candidate exact = candidate(wanted);
    if (violated(exact) == Limit::none) {
      const double before = now_.position;
      accept(exact);
      now_.position = inside(wanted_, before);
      forget_rounding();
      return now_.position == wanted_ ? Limit::none : Limit::jerk;
    }
  }

  // else come as near as the limits allow
  return accelerate(tracked ? std::clamp(wanted, allowed.low, allowed.high)
                            : goal(step, lag, allowed));
}

/// Takes the allowed acceleration nearest to `best`; that of the last state's stop always is one.
Limit NumberLimiter::accelerate(double best) noexcept {
  know_stop();
  Candidate next = candidate(best);
  Limit reason = violated(next);
  if (reason == Limit::none) {
    accept(next);
    return std::abs(best) == rates_.acceleration ? Limit::acceleration : Limit::jerk;
  }
  double allowed = stop_.acceleration(stopped_ + 1);
  double refused = best;
  bool better = false;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = allowed + (refused - allowed) / 2.0;
    const Candidate tried = candidate(middle);
    if (const Limit why = violated(tried); why != Limit::none) {
      refused = middle;
      reason = why;
    } else {
      allowed = middle;
      next = tried;
      better = true;
    }
  }
  if (better) {
    accept(next);
  } else {
    slow_down();
  }
  return reason;
}

Limit NumberLimiter::nearest_speed(double wanted) noexcept {
  if (std::isfinite(rates_.jerk)) {
    const auto [low, high] = accelerations();
    const Limit reason = accelerate(std::clamp(wanted - now_.speed, low, high));
    return reason == Limit::minimum || reason == Limit::maximum ? reason : Limit::none;
  }
  const Span stopping = speeds();
  const double highest = std::max(stopping.high, now_.speed - rates_.acceleration);
  const double lowest = std::min(stopping.low, now_.speed + rates_.acceleration);
  move(std::clamp(wanted, lowest, highest));
  if (wanted > highest + slack()) return Limit::maximum;
  return wanted < lowest - slack() ? Limit::minimum : Limit::none;
}

void NumberLimiter::slow_down() noexcept {
  if (!std::isfinite(rates_.jerk)) {
    const double less =
        std::isfinite(rates_.acceleration) ? std::abs(now_.speed) - rates_.acceleration : 0.0;
    move(std::copysign(std::max(0.0, less), now_.speed));
    if (now_.speed == 0.0) now_.speed = now_.acceleration = 0.0;
    return;
  }
  know_stop();
  ++stopped_;
  const bool last = stopped_ >= stop_.steps();
  const double acceleration = last ? 0.0 : stop_.acceleration(stopped_);
  move(last ? 0.0 : now_.speed + acceleration);
  now_.acceleration = acceleration;
  if (last) stop_ = {};
}

}  // namespace o80
