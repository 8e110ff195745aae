#include "o80/control/fastest_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace o80 {
namespace {

// no iteration more for what rounds
constexpr double kTimeRounding = 1e-12;
constexpr int kMostTries = 60;
constexpr int kMostCorrections = 8;

/// Where a function that grows from below 0 at `low` to 0 or more at `high` crosses 0, or comes as
/// near as `tolerance`; by the Illinois method, with halvings where that is slow.
template <class Function>
double root(Function&& function, double low, double high, double tolerance) noexcept {
  double at_low = function(low);
  if (at_low >= 0.0) return low;
  double at_high = function(high);
  if (at_high <= 0.0) return high;
  int side = 0;
  for (int i = 0; i < kMostTries; ++i) {
    const double width = high - low;
    if (!(width > 1e-15 * std::abs(high))) break;
    double tried = i % 4 == 3 ? low + width / 2.0 : high - at_high * width / (at_high - at_low);
    if (!(tried > low && tried < high)) tried = low + width / 2.0;
    const double value = function(tried);
    if (std::abs(value) <= tolerance) return tried;
    if (value < 0.0) {
      low = tried;
      at_low = value;
      if (side == -1) at_high /= 2.0;
      side = -1;
    } else {
      high = tried;
      at_high = value;
      if (side == 1) at_low /= 2.0;
      side = 1;
    }
  }
  return high;
}

}  // namespace

FastestMotion::FastestMotion(double position, double speed, double acceleration, double target,
                             const Rates& rates) noexcept
    : start_speed_(speed),
      start_acceleration_(std::isfinite(rates.jerk) ? acceleration : 0.0),
      distance_(target - position),
      rates_(rates),
      target_(target),
      position_(position) {
  const VelocityChange stop(-start_speed_, start_acceleration_, rates_);
  const double rounding =
      4.0 * std::numeric_limits<double>::epsilon() * std::max(std::abs(position), std::abs(target));
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

  // the speed once the present acceleration has gone: below it, it would slow down and go on
  const double size = std::abs(start_acceleration_);
  const double steps = size > 0.0 ? std::floor(size / rates_.jerk) : 0.0;
  const double fading =
      steps > 0.0 ? steps * size - rates_.jerk * steps * (steps + 1.0) / 2.0 : 0.0;
  const double flat = start_speed_ + std::copysign(fading, start_acceleration_);
  const double lowest = std::clamp(flat, 0.0, rates_.speed);
  const double most = std::ceil(time_to(rates_.speed) * (1.0 - kTimeRounding));
  const double at_most = distance(rates_.speed, most) - distance_;
  if (at_most <= 0.0) {
    // at full speed for as long as it takes
    cruise_ = rates_.speed;
    before_ = static_cast<std::int64_t>(most +
                                        std::ceil(-at_most / rates_.speed * (1.0 - kTimeRounding)));
  } else {
    // no longer than it takes to get to the cruising speed
    const auto beyond_at = [&](double cruise) {
      return distance(cruise, time_to(cruise)) - distance_;
    };
    cruise_ = root(beyond_at, lowest, rates_.speed, 1e-13 * distance_);
    before_ = static_cast<std::int64_t>(std::ceil(time_to(cruise_) * (1.0 - kTimeRounding)));
  }
  const double at_lowest = distance(lowest, static_cast<double>(before_)) - distance_;
  if (at_lowest > 0.0) {
    // between this one and the way to rest, which are not a whole iteration apart
    cruise_ = lowest;
    share_ = at_lowest / (at_lowest + distance_ - stop.displacement() * sign_);
    stop_ = VelocityChange(-start_speed_, start_acceleration_, rates_);
  } else {
    cruise_ = cruise_for(static_cast<double>(before_), lowest, cruise_);
  }
  settle();
}

double FastestMotion::time_to(double cruise) const noexcept {
  return VelocityChange(cruise - start_speed_, start_acceleration_, rates_).time();
}

std::int64_t FastestMotion::steps_to(double cruise) const noexcept {
  return VelocityChange(cruise - start_speed_, start_acceleration_, rates_).steps();
}

double FastestMotion::distance(double cruise, double before) const noexcept {
  const VelocityChange to_cruise(cruise - start_speed_, start_acceleration_, rates_);
  const VelocityChange to_rest(-cruise, 0.0, rates_);
  return to_cruise.displacement() + before * cruise + to_rest.displacement();
}

double FastestMotion::cruise_for(double before, double low, double high) const noexcept {
  const auto beyond = [&](double cruise) { return distance(cruise, before) - distance_; };
  return root(beyond, low, high, 1e-16 * distance_);
}

void FastestMotion::settle() noexcept {
  to_cruise_ = VelocityChange(cruise_ - start_speed_, start_acceleration_, rates_);
  to_rest_ = VelocityChange(-cruise_, 0.0, rates_);
  speed_ = start_speed_;
  iterations_ = std::max({std::int64_t{1}, before_ + to_rest_.steps(), stop_.steps()});
}

void FastestMotion::stretch(std::int64_t iterations) noexcept {
  if (iterations <= iterations_ || before_ == 0) return;
  const FastestMotion shortest = *this;
  stop_ = {};
  share_ = 0.0;
  for (int i = 0; i < kMostCorrections && iterations_ != iterations; ++i) {
    before_ += iterations - iterations_;
    if (before_ < 0) break;
    cruise_ = cruise_for(static_cast<double>(before_), 0.0, cruise_);
    settle();
  }
  // early rather than late, and only on a way that there is
  if (iterations_ > iterations || to_cruise_.steps() > before_) *this = shortest;
}

double FastestMotion::next() noexcept {
  ++done_;
  if (done_ >= iterations_) return target_;
  double acceleration =
      done_ <= before_ ? to_cruise_.acceleration(done_) : to_rest_.acceleration(done_ - before_);
  if (share_ > 0.0) {
    acceleration = (1.0 - share_) * acceleration + share_ * stop_.acceleration(done_);
  }
  speed_ += acceleration;
  position_ += sign_ * speed_;
  return static_cast<double>(position_);
}

}  // namespace o80
