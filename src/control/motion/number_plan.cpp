#include "control/motion/number_plan.hpp"

#include "base/whole.hpp"

namespace o80 {
namespace {

// rounding must not exceed a limit, nor add an iteration
constexpr double kPlanRounding = 1e-9;
// numbers of iterations that the search for the fewest of a smooth motion tries
constexpr double kStride = 1.15;
constexpr int kMaxStrides = 8;
constexpr int kMaxHalvings = 10;

/// The slope at a place of a curve that does not overshoot: M. Steffen, A simple method for
/// monotonic interpolation in one dimension, Astron. Astrophys. 239 (1990). The places before and
/// after it are so many iterations away.
double slope_at(double before, double iterations, double place, double next_iterations,
                double after) noexcept {
  const double a = place / iterations - before / iterations;
  const double b = after / next_iterations - place / next_iterations;
  if (!((a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0))) return 0.0;
  const double both = iterations + next_iterations;
  const double mean = std::abs(a * (next_iterations / both) + b * (iterations / both)) / 2.0;
  const double slope = 2.0 * std::min({std::abs(a), std::abs(b), mean});
  return std::isfinite(slope) ? std::copysign(slope, a) : 0.0;
}

double limited(double value, double most) noexcept {
  return std::isfinite(value) ? std::clamp(value, -most, most) : 0.0;
}

/// Slope and curvature of a smooth curve at a row: those of the parabola through the place before
/// it, so many iterations ago, the row, and the next one. They are bounded, because the places may
/// be far apart in time on one side only.
void bend_at(Moment& row, double way, double iterations, const RowsAhead& ahead) noexcept {
  if (ahead.iterations == 0) return;  // it rests at the last row
  const auto behind = static_cast<double>(ahead.iterations);
  const double both = iterations + behind;
  const double next_way = ahead.next - row.position;
  const double before = way / iterations;
  const double after = next_way / behind;
  const double slope = before * (behind / both) + after * (iterations / both);
  const double curvature = 2.0 * (after - before) / both;
  // the way to the first row is as long as the take-over
  const double other = ahead.is_first ? ahead.after - ahead.next : way;
  const double step = std::max(std::abs(next_way), std::abs(other));
  const double time = ahead.is_first ? behind : std::max(iterations, behind);
  row.speed = limited(slope, 2.0 * step / time);
  row.acceleration = limited(curvature, 4.0 * step / (time * time));
}

/// The fraction `share` between `from` and `to`, never outside, despite rounding and overflow.
double between(double from, double to, double share) noexcept {
  const double distance = to - from;
  const double value = from + distance * share;
  const double low = std::min(from, to);
  const double high = std::max(from, to);
  if (value >= low && value <= high) return value;
  if (std::isfinite(distance)) return std::clamp(value, low, high);
  const double weighed = from * (1.0 - share) + to * share;
  return std::isfinite(weighed) ? weighed : to;
}

}  // namespace

std::int64_t iterations_of(double distance, double speed) noexcept {
  if (!std::isfinite(speed)) return 1;
  const double up = whole_above(std::abs(distance) / speed * (1.0 - kPlanRounding));
  if (!(up <= static_cast<double>(kLongestPlan))) return kLongestPlan + 1;
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(up));
}

std::int64_t NumberPlan::propose(const PlanTask& task) noexcept {
  task_ = task;
  fastest_.reset();
  smooth_for_ = 0;
  const std::int64_t requested = task.iterations;
  const bool is_smooth = task.profile == Profile::minimum_jerk;
  if (requested > 0 && is_smooth && std::isfinite(task.rates.acceleration) && smooth(requested)) {
    return requested;
  }
  const bool keeps_speed = is_smooth && std::isfinite(task.cruise);
  if (keeps_speed && smooth_from_rest()) return std::max(requested, smooth_for_);
  std::int64_t least = fewest();
  if (keeps_speed && least <= kLongestPlan) least = fewest_smooth(least);
  return std::max(requested, least);
}

/// Plans the shortest smooth motion from rest: its peaks of speed, acceleration and jerk are nearly
/// those of a continuous motion that takes two or three iterations longer. False for other motions,
/// or if the fewest iterations are not found nearby.
bool NumberPlan::smooth_from_rest() noexcept {
  if (task_.from.speed != 0.0 || task_.from.acceleration != 0.0) return false;
  const double way = std::abs(task_.target - task_.from.position);
  const Rates& most = task_.rates;
  const double time = std::max({15.0 / 8.0 * way / std::min(most.speed, task_.cruise) - 2.0,
                                std::sqrt(10.0 / std::sqrt(3.0) * way / most.acceleration) - 2.0,
                                std::cbrt(60.0 * way / most.jerk) - 3.0, 1.0});
  if (!(time <= static_cast<double>(kLongestPlan))) return false;
  auto fewest = static_cast<std::int64_t>(whole_above(time));
  for (int i = 0; fewest > 1 && smooth(fewest - 1); ++i, --fewest) {
    if (i == 2) return false;
  }
  return smooth(fewest) || smooth(fewest + 1);
}

/// The fewest iterations of a motion at full speed, or at the cruising speed asked for.
std::int64_t NumberPlan::fewest() noexcept {
  Rates rates = task_.rates;
  rates.speed = std::min(rates.speed, task_.cruise);
  const double distance = std::abs(task_.target - task_.from.position);
  if (!std::isfinite(rates.acceleration)) {
    return iterations_of(task_.target - task_.line_start, rates.speed);
  }
  // no motion is shorter; beyond the range of the plan nothing is computed
  constexpr auto kMost = static_cast<double>(kLongestPlan);
  if (!(distance <= kMost * rates.speed && distance <= kMost * kMost * rates.acceleration &&
        distance <= kMost * kMost * kMost * rates.jerk &&
        std::abs(task_.from.speed) <= kMost * rates.acceleration &&
        rates.acceleration <= 2.0 * kMost * rates.jerk)) {
    return kLongestPlan + 1;
  }
  return fastest_.emplace(task_.from, task_.target, rates, task_.stop).iterations();
}

/// The fewest iterations, from about `least` on, in which a smooth motion keeps the speed asked for
/// and all limits; `least` if there are none.
std::int64_t NumberPlan::fewest_smooth(std::int64_t least) noexcept {
  std::int64_t few = 0;
  std::int64_t enough = std::max<std::int64_t>(1, least - 3);
  for (int i = 0; !smooth(enough); ++i) {
    if (i == kMaxStrides) return least;
    few = enough;
    enough = static_cast<std::int64_t>(whole_above(static_cast<double>(enough) * kStride));
  }
  while (enough - few > 1) {
    const std::int64_t middle = few + (enough - few) / 2;
    (smooth(middle) ? enough : few) = middle;
  }
  smooth(enough);
  return enough;
}

/// `speed`: of its start. In that direction it may be faster than the speed asked for.
bool NumberPlan::fits(const SmoothMotion& motion, double speed) const noexcept {
  const SmoothMotion::Extremes most = motion.extremes();
  const auto fastest = [&](double side) {
    return std::min(task_.rates.speed, std::max(task_.cruise, side * speed));
  };
  const auto within = [](double value, double limit) {
    return value <= limit * (1.0 + kPlanRounding / 2.0);
  };
  const double rounding = 4.0 * std::numeric_limits<double>::epsilon() *
                          std::max(std::abs(task_.span.low), std::abs(task_.span.high));
  return most.positions.low >= task_.span.low - rounding &&
         most.positions.high <= task_.span.high + rounding &&
         within(most.speeds.high, fastest(1.0)) && within(-most.speeds.low, fastest(-1.0)) &&
         within(most.acceleration, task_.rates.acceleration) && within(most.jerk, task_.rates.jerk);
}

/// Plans a smooth motion; false if none keeps all limits in this number of iterations.
bool NumberPlan::plan_smooth(std::int64_t iterations) noexcept {
  smooth_for_ = iterations;
  shape_ = Shape::smooth;
  smooth_ = SmoothMotion(task_.from, task_.target, iterations);
  if (fits(smooth_, task_.from.speed)) return true;
  const bool moves = task_.from.speed != 0.0 || task_.from.acceleration != 0.0;
  if (!std::isfinite(task_.rates.acceleration) && moves && stop_then_smooth(iterations))
    return true;
  if (!task_.stays || !moves) return false;
  // it can begin as from rest, if the step from its present speed to the first one keeps the limits
  smooth_ = SmoothMotion({task_.from.position}, task_.target, iterations);
  const double first = smooth_.position(1.0) - task_.from.position;
  const double second = smooth_.position(2.0) - smooth_.position(1.0);
  const double a1 = first - task_.from.speed;
  const double a2 = second - first;
  return std::abs(a1) <= task_.rates.acceleration &&
         std::abs(a1 - task_.from.acceleration) <= task_.rates.jerk &&
         std::abs(a2 - a1) <= task_.rates.jerk && fits(smooth_, 0.0);
}

/// Without a limit of acceleration: comes to rest in a half, a quarter, ... of the iterations, the
/// most that stay inside, and then goes to the target.
bool NumberPlan::stop_then_smooth(std::int64_t iterations) noexcept {
  stop_ = iterations / 2;
  for (int i = 0; i < kMaxHalvings && stop_ > 0; ++i, stop_ /= 2) {
    const auto r = static_cast<double>(stop_);
    const double rest =
        task_.from.position + r * task_.from.speed / 2.0 + r * r * task_.from.acceleration / 12.0;
    if (!(rest >= task_.span.low && rest <= task_.span.high)) continue;
    to_stop_ = SmoothMotion(task_.from, rest, stop_);
    if (!fits(to_stop_, task_.from.speed)) continue;
    smooth_ = SmoothMotion({rest}, task_.target, iterations - stop_);
    if (!fits(smooth_, 0.0)) continue;
    shape_ = Shape::stop_first;
    return true;
  }
  return false;
}

void NumberPlan::settle(std::int64_t iterations) noexcept {
  done_ = 0;
  iterations_ = iterations;
  const bool accelerates = std::isfinite(task_.rates.acceleration);
  const bool is_smooth = task_.profile == Profile::minimum_jerk && (accelerates || iterations > 1);
  const std::int64_t proposed = smooth_for_;
  if (is_smooth && smooth(iterations)) return;
  shape_ = Shape::line;
  if (!accelerates) return;
  if (!fastest_) fewest();
  if (!fastest_) return;  // too far for a plan: on a line the guard keeps the limits
  if (fastest_->iterations() > iterations && is_smooth && proposed > 0 && smooth(proposed)) return;
  fastest_->stretch(iterations);
  shape_ = Shape::fastest;
}

double NumberPlan::next() noexcept {
  ++done_;
  if (done_ >= iterations_) return task_.target;
  return shape_ == Shape::fastest ? fastest_->next() : at(done_);
}

/// The position after so many iterations, fewer than there are, of any shape but the fastest.
double NumberPlan::at(std::int64_t done) const noexcept {
  const auto i = static_cast<double>(done);
  const double share = i / static_cast<double>(iterations_);
  switch (shape_) {
    case Shape::smooth:
      return done < smooth_for_ ? smooth_.position(i) : task_.target;
    case Shape::stop_first:
      return done <= stop_ ? to_stop_.position(i)
                           : smooth_.position(static_cast<double>(done - stop_));
    case Shape::monotone:
    case Shape::curve:
      return on_rows(share);
    case Shape::line:
    case Shape::fastest:
      break;
  }
  return between(task_.line_start, task_.target, share);
}

Span NumberPlan::curve_on(Profile profile, double target, std::int64_t iterations,
                          const RowsAhead& ahead, const Span& bounds) noexcept {
  from_ = moment();
  line(from_.position, target);
  line_for(iterations);
  to_ = {target};
  cut_ = false;
  const bool is_monotone = profile == Profile::monotone;
  shape_ = is_monotone ? Shape::monotone : Shape::curve;
  return is_monotone ? monotone_on(ahead) : smooth_on(ahead, bounds);
}

Span NumberPlan::monotone_on(const RowsAhead& ahead) noexcept {
  const auto n = static_cast<double>(iterations_);
  if (ahead.iterations > 0) {
    to_.speed = slope_at(from_.position, n, to_.position, static_cast<double>(ahead.iterations),
                         ahead.next);
  }
  const double bend = from_.position + n * from_.speed / 3.0;
  hull_ = {to_.position, to_.position};
  hull_.include(from_.position);
  if (std::isfinite(bend)) hull_.include(bend);
  return hull_;
}

/// The polynomial of degree 5 with place, slope and curvature of the plan before and of the row.
Span NumberPlan::smooth_on(const RowsAhead& ahead, const Span& bounds) noexcept {
  const auto n = static_cast<double>(iterations_);
  const double way = to_.position - from_.position;
  const double most = 4.0 * (std::abs(way) + std::abs(from_.speed) * n) / (n * n);
  from_.acceleration = limited(from_.acceleration, most);
  bend_at(to_, way, n, ahead);

  // its coefficients in the basis of Bernstein: it stays between them
  hull_ = {to_.position, to_.position};
  hull_.include(from_.position);
  const auto include = [](Span& span, const Moment& knot, double time) {
    const double first = knot.position + time / 5.0 * knot.speed;
    const double second = first + time / 5.0 * knot.speed + time * time / 20.0 * knot.acceleration;
    if (std::isfinite(first)) span.include(first);
    if (std::isfinite(second)) span.include(second);
  };
  include(hull_, from_, n);
  include(hull_, to_, -n);
  Span reach = hull_;
  if (ahead.iterations > 0) include(reach, to_, static_cast<double>(ahead.iterations));
  Span allowed = bounds;
  allowed.include(from_.position);
  allowed.include(to_.position);
  cut_ = hull_.low < allowed.low || hull_.high > allowed.high;
  if (cut_) hull_ = {std::max(hull_.low, allowed.low), std::min(hull_.high, allowed.high)};

  const double v0 = n * from_.speed;
  const double v1 = n * to_.speed;
  const double c0 = n * n / 2.0 * from_.acceleration;
  const double c1 = n * n / 2.0 * to_.acceleration;
  order_ = {v0, c0, 10.0 * way - 6.0 * v0 - 4.0 * v1 - 3.0 * c0 + c1,
            -15.0 * way + 8.0 * v0 + 7.0 * v1 + 3.0 * c0 - 2.0 * c1,
            6.0 * way - 3.0 * v0 - 3.0 * v1 - c0 + c1};
  return reach;
}

/// The place at this share of the way to a row. Apart, so that other motions pay nothing for it.
[[gnu::noinline]] double NumberPlan::on_rows(double share) const noexcept {
  if (shape_ == Shape::curve) return std::clamp(curve_at(share), hull_.low, hull_.high);
  // in the basis of Hermite; where a sum overflows, a straight line
  const double rest = 1.0 - share;
  const double n = static_cast<double>(iterations_);
  const double place = from_.position * ((1.0 + 2.0 * share) * rest * rest) +
                       to_.position * (share * share * (3.0 - 2.0 * share)) +
                       from_.speed * (n * share * rest * rest) -
                       to_.speed * (n * share * share * rest);
  return std::clamp(std::isfinite(place) ? place : between(from_.position, to_.position, share),
                    hull_.low, hull_.high);
}

/// The place at this share of a curve, where bounds do not hold it.
double NumberPlan::curve_at(double share) const noexcept {
  const auto& [a, b, c, d, e] = order_;
  const double place =
      from_.position + share * (a + share * (b + share * (c + share * (d + share * e))));
  // where a sum overflows, a straight line
  return std::isfinite(place) ? place : between(from_.position, to_.position, share);
}

bool NumberPlan::is_held() const noexcept {
  if (!cut_ || shape_ != Shape::curve || done_ >= iterations_) return false;
  const double place = curve_at(static_cast<double>(done_) / static_cast<double>(iterations_));
  return place < hull_.low || place > hull_.high;
}

Moment NumberPlan::moment() const noexcept {
  if (done_ > iterations_) return {task_.target};
  if (done_ == iterations_) return {task_.target, to_.speed, to_.acceleration};
  Moment now{at(done_), to_.speed};
  const double n = static_cast<double>(iterations_);
  const double share = static_cast<double>(done_) / n;
  if (shape_ == Shape::monotone) {
    const double rest = 1.0 - share;
    const double way = to_.position - from_.position;
    now.speed = way * (6.0 * share * rest / n) + from_.speed * (rest * (1.0 - 3.0 * share)) +
                to_.speed * (share * (3.0 * share - 2.0));
    now.acceleration = (way / n * (6.0 - 12.0 * share) + from_.speed * (6.0 * share - 4.0) +
                        to_.speed * (6.0 * share - 2.0)) /
                       n;
  }
  if (shape_ == Shape::curve) {
    const auto& [a, b, c, d, e] = order_;
    now.speed =
        (a + share * (2.0 * b + share * (3.0 * c + share * (4.0 * d + share * 5.0 * e)))) / n;
    now.acceleration =
        (2.0 * b + share * (6.0 * c + share * (12.0 * d + share * 20.0 * e))) / (n * n);
  }
  if (!std::isfinite(now.speed)) now.speed = 0.0;
  if (!std::isfinite(now.acceleration)) now.acceleration = 0.0;
  return now;
}

double iterations_to_take_over(const Moment& from, double row, double iterations,
                               const Rates& rates) noexcept {
  const double way = row - from.position - iterations * from.speed -
                     iterations * iterations / 2.0 * from.acceleration;
  constexpr double kFarthest = 1e300;  // finite below, too
  const double d = std::isfinite(way) ? std::min(std::abs(way), kFarthest) : kFarthest;
  return std::max({1.9 * d / rates.speed, std::sqrt(5.8 * d / rates.acceleration),
                   std::cbrt(60.0 * d / rates.jerk)});
}

}  // namespace o80
