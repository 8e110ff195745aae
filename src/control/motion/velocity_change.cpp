#include "control/motion/velocity_change.hpp"

#include <utility>

#include "base/whole.hpp"

namespace o80 {
namespace {

// longest motion; keeps sums of squares within the range of a double
constexpr double kMaxSteps = 1e12;
// a limit may be exceeded by rounding; rounding must not add an iteration
constexpr double kChangeRounding = 1e-12;

double share_between(double wanted, double at_zero, double at_one) noexcept {
  const double range = at_one - at_zero;
  if (range == 0.0) return 0.0;
  return std::clamp((wanted - at_zero) / range, 0.0, 1.0);
}

}  // namespace

/// Full acceleration, and the remainder in the last iteration.
void VelocityChange::plan_without_jerk(double change) noexcept {
  if (change == 0.0) return;
  sign_ = change < 0.0 ? 1.0 : -1.0;
  const double size = std::abs(change);
  if (!std::isfinite(acceleration_)) acceleration_ = size;
  const double steps =
      std::min(whole_above(size / acceleration_ * (1.0 - kChangeRounding)), kMaxSteps);
  steps_ = static_cast<std::int64_t>(std::max(steps, 1.0));
  shorter_ = steps_ - 1;
  const auto n = static_cast<double>(shorter_);
  const double before = n * acceleration_;
  share_ = share_between(size, static_cast<double>(steps_) * acceleration_, before);
  // sum over i of v(i) - v(steps)
  displacement_ = sign_ * (acceleration_ * n * (n - 1.0) / 2.0 + (size - before) * n);
  slope_ = -n;
  share_slope_ = sign_ / acceleration_;
}

/// The sums of trough(), for its three parts: down, along the limit, up.
VelocityChange::Sums VelocityChange::sums(const Ratios& ratios, double steps) const noexcept {
  if (steps <= 0.0) return {};
  O80_COUNT(trapezoid);
  const double meet = whole_below((ratios.start + steps) / 2.0);
  const double down = std::clamp(std::min(meet, ratios.deepest), 0.0, steps);
  const double up =
      std::clamp(std::max(meet + 1.0, whole_above(steps - ratios.most)), down + 1.0, steps + 1.0);
  Sums all;
  all.change = down * start_ - jerk_ * down * (down + 1.0) / 2.0;
  all.moment =
      start_ * down * (down - 1.0) / 2.0 - jerk_ * (down - 1.0) * down * (down + 1.0) / 3.0;

  const double flat = up - 1.0 - down;
  all.change -= acceleration_ * flat;
  all.moment -= acceleration_ * ((up - 2.0) * (up - 1.0) - (down - 1.0) * down) / 2.0;

  const double rise = steps - up;  // -(steps - i) jerk, for i = up ... steps
  if (rise > 0.0) {
    all.change -= jerk_ * rise * (rise + 1.0) / 2.0;
    all.moment -= jerk_ * ((steps - 1.0) * rise * (rise + 1.0) / 2.0 -
                           rise * (rise + 1.0) * (2.0 * rise + 1.0) / 6.0);
  }
  return all;
}

void VelocityChange::plan_with_jerk(double change) noexcept {
  if (change == 0.0 && start_ == 0.0) return;
  Ratios ratios{start_ / jerk_, whole_below((start_ + acceleration_) / jerk_),
                acceleration_ / jerk_};
  const double fewest = whole_above(std::abs(ratios.start) * (1.0 - kChangeRounding));

  // compare the change with that of the direct way to acceleration 0, and of its mirror image
  Sums straight = sums(ratios, fewest);
  if (change >= straight.change) {
    start_ = -start_;
    ratios.start = -ratios.start;
    ratios.deepest = whole_below((start_ + acceleration_) / jerk_);
    const Sums crest = sums(ratios, fewest);
    if (change <= -crest.change) {
      // in between: the mean of the two ways of fewest steps
      start_ = -start_;
      steps_ = shorter_ = static_cast<std::int64_t>(fewest);
      crest_ = true;
      mean(change, straight, {-crest.change, -crest.moment});
      return;
    }
    sign_ = -1.0;
    change = -change;
    straight = crest;
  }

  // the fewest steps whose trough is deep enough: a continuous estimate, then a search
  const double missing = start_ * start_ / (2.0 * jerk_) - change;
  const double depth = std::sqrt(std::max(0.0, missing * jerk_));
  double steps = depth <= acceleration_
                     ? (start_ + 2.0 * depth) / jerk_
                     : (start_ + 2.0 * acceleration_) / jerk_ +
                           (missing - acceleration_ * acceleration_ / jerk_) / acceleration_;
  const double enough = change + kChangeRounding * std::max(std::abs(change), std::abs(start_));
  double low = fewest;  // steps that are too few
  Sums other = straight;
  steps = std::clamp(whole_below(steps), fewest + 1.0, kMaxSteps);
  Sums own = sums(ratios, steps);
  for (double stride = 1.0; own.change > enough && steps < kMaxSteps; stride *= 2.0) {
    low = steps;
    other = own;
    steps = std::min(steps + stride, kMaxSteps);
    own = sums(ratios, steps);
  }
  bool first = true;  // try one step less first: the estimate is seldom off by more than one
  while (steps - low > 1.0) {
    const double tried =
        std::exchange(first, false) ? steps - 1.0 : whole_below((low + steps) / 2.0);
    const Sums there = sums(ratios, tried);
    if (there.change > enough) {
      low = tried;
      other = there;
    } else {
      steps = tried;
      own = there;
    }
  }
  steps_ = static_cast<std::int64_t>(steps);
  shorter_ = steps_ - 1;
  const double rising = start_ > 0.0 ? whole_below(start_ / jerk_) : 0.0;
  detour_ = sign_ * (rising * start_ - jerk_ * rising * (rising + 1.0) / 2.0);
  mean(change, own, other);
}

void VelocityChange::mean(double change, const Sums& own, const Sums& other) noexcept {
  share_ = share_between(change, own.change, other.change);
  displacement_ = -sign_ * ((1.0 - share_) * own.moment + share_ * other.moment);
  const double range = own.change - other.change;
  if (range == 0.0) return;
  slope_ = (other.moment - own.moment) / range;
  share_slope_ = -sign_ / range;
}

double VelocityChange::acceleration(std::int64_t i) const noexcept {
  if (i < 1 || i > steps_) return 0.0;
  const auto at = static_cast<double>(i);
  if (!std::isfinite(jerk_)) {
    return -sign_ * (i <= shorter_ ? acceleration_ : (1.0 - share_) * acceleration_);
  }
  const double own = trough(start_, at, static_cast<double>(steps_));
  // the crest is the mirror image of a trough from -a(0)
  const double other = crest_ ? -trough(-start_, at, static_cast<double>(steps_))
                              : trough(start_, at, static_cast<double>(shorter_));
  return sign_ * ((1.0 - share_) * own + share_ * other);
}

double VelocityChange::run_before_turn(double speed) const noexcept {
  const double v = sign_ * speed;
  if (detour_ == 0.0 || v >= 0.0) return 0.0;
  // v(i) = v + i a(0) - jerk i (i + 1) / 2 while the acceleration is above 0
  const double b = start_ - jerk_ / 2.0;
  const double discriminant = b * b + 2.0 * jerk_ * v;
  const double most = whole_below(start_ / jerk_);
  const double steps =
      discriminant <= 0.0 || b <= 0.0
          ? most
          : std::clamp(whole_below((b - std::sqrt(discriminant)) / jerk_), 0.0, most);
  return sign_ * (steps * v + start_ * steps * (steps + 1.0) / 2.0 -
                  jerk_ * steps * (steps + 1.0) * (steps + 2.0) / 6.0);
}

}  // namespace o80
