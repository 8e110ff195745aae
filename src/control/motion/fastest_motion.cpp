#include "control/motion/fastest_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/root.hpp"

namespace o80 {
namespace {

// rounding must not add an iteration
constexpr double kTimeRounding = 1e-12;
// tolerances of a root, as shares of the distance
constexpr double kRootForTime = 1e-6;
constexpr double kExact = 1e-16;
constexpr double kBracket = 1e-3;
constexpr int kMaxCorrections = 8;
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
  const double steps = size > 0.0 ? std::floor(size / rates_.jerk) : 0.0;
  const double fading =
      steps > 0.0 ? steps * size - rates_.jerk * steps * (steps + 1.0) / 2.0 : 0.0;
  const double flat = start_speed_ + std::copysign(fading, start_acceleration_);
  const double lowest = std::clamp(flat, 0.0, rates_.speed);
  const double most = std::ceil(time_to(rates_.speed) * (1.0 - kTimeRounding));
  const double at_most = distance(rates_.speed, most) - distance_;
  if (at_most <= 0.0) {
    // the target is farther: cruise at full speed
    cruise_ = rates_.speed;
    before_ = static_cast<std::int64_t>(most +
                                        std::ceil(-at_most / rates_.speed * (1.0 - kTimeRounding)));
  } else {
    // the target is nearer: reduce the cruising speed until there is no time to cruise
    // for the number of iterations; the speed that fits them is found below, a little beyond it
    cruise_ = cruise_for({}, lowest, rates_.speed, kRootForTime);
    before_ = static_cast<std::int64_t>(std::ceil(time_to(cruise_) * (1.0 - kTimeRounding)));
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
