#include "control/motion/fastest_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/root.hpp"
#include "base/whole.hpp"

namespace o80 {
namespace {

// rounding must not add an iteration
constexpr double kTimeRounding = 1e-12;
// tolerances of a root, as shares of the distance
constexpr double kRootForTime = 1e-6;
constexpr double kExact = 1e-16;
constexpr double kBracket = 1e-3;
constexpr int kMaxCorrections = 8;
constexpr double kRounding = 4e-16;
constexpr double kReached = 1e-13;
constexpr int kGuesses = 4;
constexpr int kNewtonSteps = 6;   // of Newton's method: it is exact once both counts stay
constexpr double kMissed = 1e-9;  // beyond rounding; a share of the distance and of a step

}  // namespace

FastestMotion::FastestMotion(const Moment& start, double target, const Rates& rates) noexcept
    : start_speed_(start.speed),
      start_acceleration_(std::isfinite(rates.jerk) ? start.acceleration : 0.0),
      distance_(target - start.position),
      rates_(rates),
      target_(target),
      position_(start.position) {
  const VelocityChange stop(-start_speed_, start_acceleration_, rates_);
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
  const double flat = start_speed_ + std::copysign(fading, start_acceleration_);
  const double lowest = std::clamp(flat, 0.0, rates_.speed);
  if (!solve(lowest)) search(lowest);
}

/// About the cruising speed of a motion in so many iterations, 0 for the fewest, without counting
/// whole ones: four steps of Newton's method.
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
    // from the place where it has turned back
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

/// Plans the shortest motion by Newton's method: the distance is a piecewise linear and increasing
/// function of the cruising speed. False if that does not find it.
bool FastestMotion::solve(double lowest) noexcept {
  double cruise = std::max(guess(0.0, rates_.speed), lowest);
  for (int i = 0; i < kNewtonSteps; ++i) {
    cruise_at(cruise);
    const VelocityChange& up = to_cruise_;
    const VelocityChange& down = to_rest_;
    const double missing = up.displacement() + up.time() * cruise + down.displacement() - distance_;
    const bool is_full = cruise == rates_.speed && missing <= 0.0;
    if (is_full || std::abs(missing) <= kRootForTime * std::abs(distance_)) {
      double before = whole_above(up.time() * (1.0 - kTimeRounding));
      if (is_full) {
        const double left = distance_ - up.displacement() - before * cruise - down.displacement();
        before += std::max(0.0, whole_above(left / cruise * (1.0 - kTimeRounding)));
      }
      before_ = static_cast<std::int64_t>(before);
      if (reach(cruise, lowest, 0)) return true;
      if (distance(lowest, before) <= distance_) return false;
      mix(lowest);
      settle();
      return true;
    }
    const double slope = up.slope() + up.time() + cruise * up.time_slope() - down.slope();
    if (!(slope > 0.0)) return false;
    cruise = std::clamp(cruise - missing / slope, lowest, rates_.speed);
  }
  return false;
}

/// The cruising speed with which it gets to the target exactly, from one that nearly does: in
/// `before_` iterations before it slows down, or in so many iterations in total. False if there is
/// none.
bool FastestMotion::reach(double cruise, double lowest, std::int64_t iterations) noexcept {
  for (int i = 1;; ++i) {
    if (iterations > 0) before_ = iterations - to_rest_.steps();
    const auto before = static_cast<double>(before_);
    const double missing =
        to_cruise_.displacement() + before * cruise + to_rest_.displacement() - distance_;
    const double size = std::abs(distance_) + before * cruise;
    const double slope = to_cruise_.slope() + before - to_rest_.slope();
    if (!(slope > 0.0)) return false;
    const double change = missing / slope;
    if (std::abs(missing) <= kRounding * size || std::abs(change) <= kRounding * cruise ||
        i == kNewtonSteps) {
      if (to_cruise_.steps() > before_ || std::abs(missing) > kReached * size) return false;
      cruise_ = cruise;
      count();
      return true;
    }
    cruise -= change;
    if (!(cruise >= lowest && cruise <= rates_.speed)) return false;
    cruise_at(cruise);
  }
}

/// The same as solve(), by searching.
void FastestMotion::search(double lowest) noexcept {
  const double most = whole_above(time_to(rates_.speed) * (1.0 - kTimeRounding));
  const double at_most = distance(rates_.speed, most) - distance_;
  if (at_most <= 0.0) {
    // the target is farther: cruise at full speed
    cruise_ = rates_.speed;
    before_ = static_cast<std::int64_t>(
        most + whole_above(-at_most / rates_.speed * (1.0 - kTimeRounding)));
  } else {
    // the target is nearer: reduce the cruising speed until there is no time to cruise
    // for the number of iterations; the speed that fits them is found below, a little beyond it
    cruise_ = cruise_for({}, lowest, rates_.speed, kRootForTime);
    before_ = static_cast<std::int64_t>(whole_above(time_to(cruise_) * (1.0 - kTimeRounding)));
  }
  if (distance(lowest, static_cast<double>(before_)) > distance_) {
    mix(lowest);
  } else {
    const double highest = std::min(rates_.speed, cruise_ * (1.0 + kBracket));
    cruise_ = cruise_for(static_cast<double>(before_), lowest, highest, kExact);
  }
  settle();
  if (mixed_ || to_cruise_.steps() <= before_) return;
  // it cannot get to this speed in that time: to a lower one, or it takes an iteration more
  const auto time = static_cast<double>(before_);
  const double reached = root([&](double v) { return time_to(v) - time; }, lowest, cruise_, 0.0);
  const bool is_enough = distance(reached, time) >= distance_;
  if (!is_enough) ++before_;
  if (distance(lowest, static_cast<double>(before_)) > distance_) {
    mix(lowest);
  } else {
    cruise_ =
        cruise_for(static_cast<double>(before_), lowest, is_enough ? reached : cruise_, kExact);
  }
  settle();
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
/// iterations; or between the farthest of these stops and the slowest cruise. The motion is the
/// weighted mean of the two: it reaches the target because positions are linear in the
/// accelerations, and keeps the limits because they are convex.
void FastestMotion::mix(double lowest) noexcept {
  mixed_ = true;
  cruise_ = lowest;
  nearer_ = stop_after(0);
  auto most = static_cast<std::int64_t>(std::max(0.0, -start_acceleration_) / rates_.jerk);
  farther_ = stop_after(most);
  cruises_ = farther_.distance <= distance_;
  if (cruises_) {
    nearer_ = farther_;
    const double at_lowest = distance(lowest, static_cast<double>(before_));
    share_ = (at_lowest - distance_) / (at_lowest - nearer_.distance);
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

/// The cruising speed with which distance() is that to the target, up to a share of it.
double FastestMotion::cruise_for(std::optional<double> before, double low, double high,
                                 double tolerance) const noexcept {
  return root([&](double cruise) { return distance(cruise, before) - distance_; }, low, high,
              tolerance * distance_);
}

void FastestMotion::stretch(std::int64_t iterations) noexcept {
  if (iterations <= iterations_ || before_ == 0) return;
  const FastestMotion shortest = *this;
  if (!mixed_) {
    const double cruise = guess(static_cast<double>(iterations), cruise_);
    cruise_at(cruise);
    if (reach(cruise, 0.0, iterations)) return;
  }
  *this = shortest;
  // a mean of two motions that happens to have the right length still needs its own cruising speed
  bool exact = !mixed_;
  mixed_ = false;
  nearer_ = {};
  cruises_ = true;
  settle();
  for (int i = 0; i < kMaxCorrections && (iterations_ != iterations || !exact); ++i) {
    exact = true;
    before_ += iterations - iterations_;
    if (before_ < 0) break;
    cruise_ = cruise_for(static_cast<double>(before_), 0.0, cruise_, kExact);
    settle();
  }
  // keep the shortest motion if the stretched one is too long, has no time to get to its cruise, or
  // does not get to the target
  const double missing = distance_ - distance(cruise_, static_cast<double>(before_));
  if (iterations_ > iterations || to_cruise_.steps() > before_ ||
      missing > kMissed * (std::abs(distance_) + cruise_)) {
    *this = shortest;
  }
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
  position_ += sign_ * speed_;
  return static_cast<double>(position_);
}

}  // namespace o80
