#include "control/number_limiter.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace o80 {
namespace {

// rounding of the interpolation does not exceed a limit
constexpr double kLimitRounding = 1e-9;
constexpr int kHalvings = 16;

/// The highest speed from which a number stops within the distance `room`, if it slows down by
/// `acceleration` in each iteration. The iteration at that speed is included.
double speed_for(double room, double acceleration) noexcept {
  if (room <= 0.0) return 0.0;
  if (!std::isfinite(acceleration) || !std::isfinite(room)) return room;
  const double k = std::floor((std::sqrt(1.0 + 8.0 * room / acceleration) - 1.0) / 2.0);
  return (room + acceleration * k * (k + 1.0) / 2.0) / (k + 1.0);
}

}  // namespace

/// A possible next state and its shortest stop.
struct NumberLimiter::Candidate {
  double position;
  double speed;
  double acceleration;
  VelocityChange stop;
};

NumberLimiter::NumberLimiter(double minimum, double maximum, const Rates& rates) noexcept
    : minimum_(minimum),
      maximum_(maximum),
      low_(minimum),
      high_(maximum),
      rates_(rates),
      unlimited_(minimum <= -kHuge && maximum >= kHuge && !std::isfinite(rates.speed) &&
                 !std::isfinite(rates.acceleration) && !std::isfinite(rates.jerk)) {
  const double finest = std::min({rates.speed, rates.acceleration, rates.jerk});
  tolerance_ = std::isfinite(finest) ? kLimitRounding * finest : 0.0;
}

void NumberLimiter::restart(double position) noexcept {
  position_ = position;
  begin();
  stand();
}

void NumberLimiter::stand() noexcept {
  speed_ = acceleration_ = 0.0;
  stop_ = {};
  stopped_ = 0;
  stop_known_ = true;
}

void NumberLimiter::begin(const Span& span) noexcept {
  wanted_ = position_;
  scale_ = std::abs(position_);
  low_ = std::max(minimum_, span.low);
  high_ = std::min(maximum_, span.high);
}

bool NumberLimiter::stays() const noexcept {
  if (!std::isfinite(rates_.acceleration)) return true;
  const double tolerance = slack();
  if (std::abs(speed_) > rates_.acceleration + tolerance) return false;
  return std::abs(speed_) <= rates_.jerk + tolerance &&
         std::abs(speed_ + acceleration_) <= rates_.jerk + tolerance;
}

Span NumberLimiter::stop() const noexcept {
  Span visited{position_, position_};
  if (stays()) return visited;
  const VelocityChange stop(-speed_, acceleration_, rates_);
  visited.include(position_ + stop.run_before_turn(speed_));
  visited.include(position_ + stop.displacement());
  return visited;
}

bool NumberLimiter::stops_inside() const noexcept {
  const Span visited = stop();
  return visited.low >= minimum_ - rounding() && visited.high <= maximum_ + rounding();
}

/// Limits and bounds may be exceeded by rounding.
bool NumberLimiter::pass_rounded(double next) noexcept {
  const double speed = next - position_;
  const double acceleration = speed - speed_;
  const double room = rounding();
  const auto within = [&](double value, double limit) {
    return std::abs(value) <= limit * (1.0 + kLimitRounding) + room;
  };
  const double highest = std::max(maximum_, position_);
  const double lowest = std::min(minimum_, position_);
  const bool keeps = within(speed, rates_.speed) && within(acceleration, rates_.acceleration) &&
                     within(acceleration - acceleration_, rates_.jerk) && next <= highest + room &&
                     next >= lowest - room;
  if (keeps) accept(std::clamp(next, lowest, highest));
  return keeps;
}

/// Within the bounds, or no further outside than `before`.
double NumberLimiter::inside(double position, double before) const noexcept {
  return std::clamp(position, std::min(low_, before), std::max(high_, before));
}

void NumberLimiter::move(double speed) noexcept {
  position_ = inside(position_ + speed, position_);
  scale_ = std::max(scale_, std::abs(position_));
  acceleration_ = speed - speed_;
  speed_ = speed;
}

/// Treats a speed within rounding as 0.
void NumberLimiter::forget_rounding() noexcept {
  const double nothing = slack() / 100.0 + 2.0 * rounding();
  const bool steady = !std::isfinite(rates_.jerk) || std::abs(acceleration_) <= nothing;
  if (steady && std::abs(speed_) <= nothing) stand();
}

/// The speeds from which it stops inside its bounds, in both directions.
Span NumberLimiter::speeds() const noexcept {
  return {-speed_for(std::max(0.0, position_ - low_), rates_.acceleration),
          speed_for(std::max(0.0, high_ - position_), rates_.acceleration)};
}

/// The next accelerations that the limits of acceleration and jerk allow.
Span NumberLimiter::accelerations() const noexcept {
  return {std::max(acceleration_ - rates_.jerk, -rates_.acceleration),
          std::min(acceleration_ + rates_.jerk, rates_.acceleration)};
}

Limit NumberLimiter::follow_without_jerk(double step, double lag) noexcept {
  // the wanted speed: reach the wanted position, or, from farther away, approach it at the highest
  // speed from which it can stop there. Without a limit of acceleration it is always within reach
  const double closing = speed_for(std::abs(lag), rates_.acceleration);
  const bool within_reach = closing >= std::abs(lag);
  const double speed = within_reach ? wanted_ - position_ : step - std::copysign(closing, lag);

  // the allowed speeds
  const Span stopping = speeds();
  const double highest = std::min({speed_ + rates_.acceleration, rates_.speed, stopping.high});
  const double lowest = std::max({speed_ - rates_.acceleration, -rates_.speed, stopping.low});
  const bool is_inside = speed <= highest && speed >= lowest;  // mostly, so no slack is needed
  if (is_inside || (speed <= highest + slack() && speed >= lowest - slack())) {
    const double before = position_;
    move(speed);
    if (within_reach) {
      position_ = inside(wanted_, before);
      forget_rounding();
    }
    return position_ == wanted_ ? Limit::none : Limit::acceleration;
  }
  const bool upward = speed > highest;
  const double bound = upward ? highest : lowest;
  move(upward ? std::max(highest, lowest) : std::min(highest, lowest));
  if (bound == (upward ? stopping.high : stopping.low)) {
    return upward ? Limit::maximum : Limit::minimum;
  }
  return std::abs(bound) == rates_.speed ? Limit::speed : Limit::acceleration;
}

NumberLimiter::Candidate NumberLimiter::candidate(double acceleration) const noexcept {
  const double speed = speed_ + acceleration;
  return {position_ + speed, speed, acceleration, VelocityChange(-speed, acceleration, rates_)};
}

/// The limit that a candidate or its stop violates.
Limit NumberLimiter::violated(const Candidate& next) const noexcept {
  const double tolerance = slack();
  const double fastest = std::max(std::abs(next.speed), std::abs(next.speed + next.stop.detour()));
  if (fastest > rates_.speed + tolerance) return Limit::speed;
  const double end = next.position + next.stop.displacement();
  const double turn = next.position + next.stop.run_before_turn(next.speed);
  const double rounding = this->rounding();
  // outside the bounds it must not turn outward again
  const double highest = std::max(high_, std::min(next.position, turn));
  const double lowest = std::min(low_, std::max(next.position, turn));
  if (next.position > std::max(high_, position_) + rounding ||
      std::max(end, turn) > std::max(highest, next.position) + rounding ||
      (end > turn && end > highest + rounding)) {
    return Limit::maximum;
  }
  if (next.position < std::min(low_, position_) - rounding ||
      std::min(end, turn) < std::min(lowest, next.position) - rounding ||
      (end < turn && end < lowest - rounding)) {
    return Limit::minimum;
  }
  return Limit::none;
}

/// The acceleration that approaches the wanted position as fast as possible without overshoot,
/// computed in the frame that moves with the wanted position (by `step` in each iteration).
double NumberLimiter::goal(double step, double lag, double low, double high) const noexcept {
  const auto overshoot = [&](double acceleration) {
    const double speed = speed_ + acceleration - step;
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

void NumberLimiter::accept(const Candidate& next) noexcept {
  move(next.speed);
  acceleration_ = next.acceleration;
  stop_ = next.stop;
  stopped_ = 0;
  stop_known_ = true;
}

/// The shortest stop from the present state => stop_.
void NumberLimiter::know_stop() noexcept {
  if (std::exchange(stop_known_, true)) return;
  stop_ = std::isfinite(rates_.jerk) ? VelocityChange(-speed_, acceleration_, rates_)
                                     : VelocityChange();
  stopped_ = 0;
}

Limit NumberLimiter::follow_with_jerk(double step, double lag) noexcept {
  know_stop();
  const double tolerance = slack();
  const auto [low, high] = accelerations();

  // reach the wanted position exactly, if it can stay there
  const double wanted = wanted_ - position_ - speed_;
  const double relative = wanted_ - position_ - step;
  const bool tracked = lag == 0.0;
  const bool stays =
      tracked || (std::abs(relative) <= rates_.jerk && std::abs(relative + wanted) <= rates_.jerk);
  if (stays && wanted >= low - tolerance && wanted <= high + tolerance) {
    const Candidate exact = candidate(wanted);
    if (violated(exact) == Limit::none) {
      const double before = position_;
      accept(exact);
      position_ = inside(wanted_, before);
      forget_rounding();
      return position_ == wanted_ ? Limit::none : Limit::jerk;
    }
  }

  // else come as near as the limits allow
  return accelerate(tracked ? std::clamp(wanted, low, high) : goal(step, lag, low, high));
}

/// Takes the acceleration nearest to `best` that the limits allow; the stop from the last state is
/// always possible.
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

void NumberLimiter::place(const Moment& now) noexcept {
  position_ = wanted_ = now.position;
  speed_ = now.speed;
  acceleration_ = now.acceleration;
  scale_ = std::abs(position_);
  stop_known_ = false;
}

Limit NumberLimiter::nearest_speed(double wanted) noexcept {
  if (std::isfinite(rates_.jerk)) {
    const auto [low, high] = accelerations();
    const Limit reason = accelerate(std::clamp(wanted - speed_, low, high));
    return reason == Limit::minimum || reason == Limit::maximum ? reason : Limit::none;
  }
  const Span stopping = speeds();
  const double highest = std::max(stopping.high, speed_ - rates_.acceleration);
  const double lowest = std::min(stopping.low, speed_ + rates_.acceleration);
  move(std::clamp(wanted, lowest, highest));
  if (wanted > highest + slack()) return Limit::maximum;
  return wanted < lowest - slack() ? Limit::minimum : Limit::none;
}

void NumberLimiter::brake() noexcept {
  if (!std::isfinite(rates_.acceleration)) {
    rest();
  } else if (stays()) {
    acceleration_ = -speed_;
    speed_ = 0.0;
    stop_known_ = false;
  } else {
    slow_down();
  }
  wanted_ = position_;
}

void NumberLimiter::slow_down() noexcept {
  if (!std::isfinite(rates_.jerk)) {
    const double less =
        std::isfinite(rates_.acceleration) ? std::abs(speed_) - rates_.acceleration : 0.0;
    move(std::copysign(std::max(0.0, less), speed_));
    if (speed_ == 0.0) speed_ = acceleration_ = 0.0;
    return;
  }
  know_stop();
  ++stopped_;
  const bool last = stopped_ >= stop_.steps();
  const double acceleration = last ? 0.0 : stop_.acceleration(stopped_);
  move(last ? 0.0 : speed_ + acceleration);
  acceleration_ = acceleration;
  if (last) stop_ = {};
}

}  // namespace o80
