#include "control/motion/fastest_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/whole.hpp"

namespace o80 {
namespace {

// rounding must not add an iteration
constexpr double kTimeRounding = 1e-12;
constexpr double kRounding = 4e-16;
constexpr double kMissed = 1e-9;  // beyond rounding; a share of the distance and of a step
constexpr int kGuesses = 4;
constexpr int kNewtonSteps = 6;  // the usual ones; then it halves
constexpr int kMaxTries = 60;

}  // namespace

FastestMotion::FastestMotion(const Moment& start, double target, const Rates& rates,
                             const VelocityChange& stop) noexcept
    : start_speed_(start.speed),
      start_acceleration_(std::isfinite(rates.jerk) ? start.acceleration : 0.0),
      distance_(target - start.position),
      rates_(rates),
      target_(target),
      position_(start.position) {
  const double rounding = 4.0 * std::numeric_limits<double>::epsilon() *
                          std::max(std::abs(start.position), std::abs(target));
  const double beyond = distance_ - stop.displacement();
  if (std::abs(beyond) <= rounding) {
    to_rest_ = stop;
    speed_ = start_speed_;
    iterations_ = std::max<std::int64_t>(1, stop.steps());
    return;
  }
  if (beyond < 0.0) {
    sign_ = -1.0;
    start_speed_ = -start_speed_;
    start_acceleration_ = -start_acceleration_;
    distance_ = -distance_;
  }

  // the speed after the present acceleration has faded out: the lowest cruising speed
  const double size = std::abs(start_acceleration_);
  const double steps = size > 0.0 ? whole_below(size / rates_.jerk) : 0.0;
  const double fading =
      steps > 0.0 ? steps * size - rates_.jerk * steps * (steps + 1.0) / 2.0 : 0.0;
  // not below it by rounding: from there on it may need an iteration more
  const double flat = start_speed_ * (1.0 + kRounding) + std::copysign(fading, start_acceleration_);
  const double lowest = std::clamp(flat, 0.0, rates_.speed);
  plan(lowest);
}

/// About the cruising speed of a motion in so many iterations, 0 for the fewest, without counting
/// whole ones.
double FastestMotion::guess(double iterations, double highest) const noexcept {
  const double kink = rates_.acceleration * (rates_.acceleration / rates_.jerk);
  struct Time {
    double value;
    double slope;
  };
  const auto time_for = [&](double change) {
    const double size = std::max(std::abs(change), std::numeric_limits<double>::min());
    if (size >= kink) {
      return Time{size / rates_.acceleration + rates_.acceleration / rates_.jerk,
                  1.0 / rates_.acceleration};
    }
    const double half = std::sqrt(size / rates_.jerk);
    return Time{2.0 * half, half / size};
  };
  // as if it had begun without acceleration, or began once that has faded
  const double speed = start_speed_;
  double base = 0.0;
  double time = 0.0;
  double way = 0.0;
  const auto begin = [&](double side) {
    const double faded = side * start_acceleration_ / rates_.jerk;
    base = speed - start_acceleration_ * faded / 2.0;
    time = iterations + faded;
    way = distance_ + speed / 2.0 + base * faded + start_acceleration_ * faded * faded / 6.0;
  };
  begin(1.0);
  double cruise = 0.0;
  if (iterations > 0.0) {
    if (base > 0.0 && base * (time - time_for(base).value / 2.0) > way) begin(-1.0);
    cruise = std::clamp(way / time, 0.0, highest);
  } else {
    // at full acceleration, up and down
    const double square =
        kink * kink / 4.0 + rates_.acceleration * way + base * (base - kink) / 2.0;
    cruise = std::sqrt(std::max(0.0, square)) - kink / 2.0;
    if (cruise >= kink && cruise - base >= kink) return std::min(cruise, highest);
    // else from the place where it has turned back
    const double back = std::min(base, 0.0);
    const double left = std::max(0.0, way + back * back / (2.0 * rates_.acceleration));
    const double far = std::sqrt(rates_.acceleration * left);
    const double near = std::cbrt(rates_.jerk / 4.0 * left * left);
    cruise = std::min(highest, std::max(base, 0.0) + std::min(far, near));
  }
  for (int i = 0; i < kGuesses; ++i) {
    const Time up = time_for(cruise - base);
    const Time down = time_for(cruise);
    const double up_slope = cruise < base ? -up.slope : up.slope;
    const double mean = (base + cruise) / 2.0;
    double missing = mean * up.value + cruise / 2.0 * down.value - way;
    double slope = (up.value + down.value) / 2.0 + mean * up_slope + cruise / 2.0 * down.slope;
    if (iterations > 0.0) {
      const double rest = time - up.value - down.value;
      missing += rest * cruise;
      slope += rest - cruise * (up_slope + down.slope);
    }
    if (!(slope > 0.0)) break;
    cruise = std::clamp(cruise - missing / slope, 0.0, highest);
  }
  return cruise;
}

/// Finds the cruising speed from `low` to `high` with which it gets to the target, from one nearby,
/// by Newton's method. `before` gives the iterations before it slows down; where they do not depend
/// on the cruise, the distance is piecewise linear in it. Returns 0, or by how much it goes too far
/// at `low` (above 0) or not far enough at `high` (below 0).
template <class Time>
double FastestMotion::reach(double low, double high, Time&& before) noexcept {
  const Span all{low, high};
  for (int i = 0; i < kMaxTries; ++i) {
    const Before time = before();
    const double missing = distance(time.value) - distance_;
    const bool is_linear = time.slope == 0.0;
    const double rounding = is_linear ? kRounding : kTimeRounding / 10.0;
    if (std::abs(missing) <= rounding * (std::abs(distance_) + time.value * cruise_)) return 0.0;
    if (missing > 0.0 ? cruise_ == all.low : cruise_ == all.high) return missing;
    (missing < 0.0 ? low : high) = cruise_;
    const double slope = to_cruise_.slope() + time.value + cruise_ * time.slope - to_rest_.slope();
    const double change = -missing / slope;
    const bool rises = slope > 0.0;
    double next = cruise_ + change;
    if (rises && next > low && next < high) {
      if (extend(change)) {
        if (is_linear) return 0.0;
        continue;
      }
    } else {
      next = rises && i < kNewtonSteps ? std::clamp(next, low, high) : low + (high - low) / 2.0;
    }
    cruise_at(next);
  }
  return 0.0;
}

/// Plans the shortest motion.
void FastestMotion::plan(double lowest) noexcept {
  cruise_at(std::max(guess(0.0, rates_.speed), lowest));
  const double missing = reach(lowest, rates_.speed,
                               [&] { return Before{to_cruise_.time(), to_cruise_.time_slope()}; });
  double before = whole_above(to_cruise_.time() * (1.0 - kTimeRounding));
  if (missing < 0.0) {  // at full speed, for longer
    const double left = distance_ - distance(before);
    before += std::max(0.0, whole_above(left / cruise_ * (1.0 - kTimeRounding)));
  }
  before_ = static_cast<std::int64_t>(before);
  const auto whole = [&] { return Before{static_cast<double>(before_)}; };
  double excess = reach(lowest, rates_.speed, whole);
  while (excess <= 0.0 && to_cruise_.steps() > before_) {
    ++before_;
    excess = reach(lowest, rates_.speed, whole);
  }
  if (excess > 0.0) mix(excess);
  count();
}

FastestMotion::Stop FastestMotion::stop_after(std::int64_t eased) const noexcept {
  const auto k = static_cast<double>(eased);
  const double jerk = eased > 0 ? std::copysign(rates_.jerk, -start_acceleration_) : 0.0;
  const double acceleration = start_acceleration_ + k * jerk;
  const double speed = start_speed_ + k * start_acceleration_ + jerk * k * (k + 1.0) / 2.0;
  const double moved = k * start_speed_ + start_acceleration_ * k * (k + 1.0) / 2.0 +
                       jerk * k * (k + 1.0) * (k + 2.0) / 6.0;
  Stop stop{start_acceleration_, jerk, eased, 0.0, VelocityChange(-speed, acceleration, rates_)};
  stop.distance = moved + stop.rest.displacement();
  return stop;
}

/// The target lies between the ends of two stops that reduce the deceleration for k and k + 1
/// iterations; or between the farthest of these stops and the slowest cruise, which goes too far by
/// `excess`. The motion is the weighted mean of the two: it reaches the target because positions
/// are linear in the accelerations, and keeps the limits because they are convex.
void FastestMotion::mix(double excess) noexcept {
  mixed_ = true;
  nearer_ = stop_after(0);
  const double ratio = std::max(0.0, -start_acceleration_) / rates_.jerk;
  auto most = static_cast<std::int64_t>(ratio * (1.0 + kMissed));
  farther_ = stop_after(most);
  cruises_ = farther_.distance <= distance_;
  if (cruises_) {
    nearer_ = farther_;
    share_ = excess / (excess + (distance_ - nearer_.distance));
    return;
  }
  while (most - nearer_.eased > 1) {
    const Stop tried = stop_after(nearer_.eased + (most - nearer_.eased) / 2);
    if (tried.distance > distance_) {
      farther_ = tried;
      most = tried.eased;
    } else {
      nearer_ = tried;
    }
  }
  share_ = (farther_.distance - distance_) / (farther_.distance - nearer_.distance);
}

void FastestMotion::stretch(std::int64_t iterations) noexcept {
  if (iterations <= iterations_ || before_ == 0) return;
  const double shortest = cruise_;
  const std::int64_t before = before_;
  const auto all = static_cast<double>(iterations);
  cruise_at(guess(all, shortest));
  reach(0.0, shortest, [&] { return Before{all - static_cast<double>(to_rest_.steps())}; });
  before_ = iterations - to_rest_.steps();
  const double missed = std::abs(distance(static_cast<double>(before_)) - distance_);
  if (to_cruise_.steps() > before_ || missed > kMissed * (std::abs(distance_) + cruise_)) {
    // it has no time to get to its cruise, or does not get to the target
    before_ = before;
    return cruise_at(shortest);
  }
  mixed_ = false;
  nearer_ = {};
  cruises_ = true;
  count();
}

double FastestMotion::next() noexcept {
  ++done_;
  if (done_ >= iterations_) return target_;
  double acceleration = !cruises_          ? farther_.acceleration(done_)
                        : done_ <= before_ ? to_cruise_.acceleration(done_)
                                           : to_rest_.acceleration(done_ - before_);
  if (mixed_) {
    acceleration = (1.0 - share_) * acceleration + share_ * nearer_.acceleration(done_);
  }
  speed_ += acceleration;
  position_ += sign_ < 0.0 ? -speed_ : speed_;
  return static_cast<double>(position_);
}

}  // namespace o80
