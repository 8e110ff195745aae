#include "control/motion/motion.hpp"

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <type_traits>
#include <utility>

#include "describe/visit_number.hpp"

namespace o80 {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

template <class T>
void store(std::byte* out, T value) noexcept {
  std::memcpy(out, &value, sizeof value);
}

template <class T, class Real>
T to_integer(Real value) noexcept {
  using Range = std::numeric_limits<T>;
  const Real rounded = std::round(value);
  if (!(rounded > static_cast<Real>(Range::min()))) return Range::min();
  if (!(rounded < static_cast<Real>(Range::max()))) return Range::max();
  return static_cast<T>(rounded);
}

/// The nearest float from `low` to `high`.
float nearest_float(double value, double low, double high) noexcept {
  auto narrow = static_cast<float>(value);
  if (narrow > high) narrow = std::nextafter(narrow, -HUGE_VALF);
  if (narrow < low) narrow = std::nextafter(narrow, HUGE_VALF);
  return narrow;
}

double nearest_whole(double value, double low, double high) noexcept {
  double whole = std::round(value);
  if (whole > high) whole = std::floor(value);
  if (whole < low) whole = std::ceil(value);
  return whole;
}

}  // namespace

Motion::Motion(const Schema& schema, const ActuatorRow& actuator, const StateLayout& layout)
    : layout_(layout),
      stride_((layout.size() + 15) / 16 * 16),
      ends_(3 * stride_ / sizeof(std::uint64_t)) {
  const double period = static_cast<double>(schema.head.period) / 1e9;
  for (std::uint32_t i = 0; i < layout.numbers().size(); ++i) {
    const NumberPlace& place = layout.numbers()[i];
    if (layout.hooks().blend != nullptr) continue;
    if (!place.moves()) {
      switches_.push_back(i);
      continue;
    }
    const LimitRow& row = schema.limits.at(actuator.first_limit + i);
    const Rates rates{row.speed * period, row.acceleration * period * period,
                      row.jerk * period * period * period};
    const bool limited =
        row.minimum > -kUnlimited || row.maximum < kUnlimited || rates.speed < kUnlimited;
    // the range of its kind also bounds the motion to rest
    const auto [lowest, highest] = visit_number(place.kind, []<class T>(T) {
      using Range = std::numeric_limits<T>;
      return std::pair(static_cast<double>(Range::lowest()), static_cast<double>(Range::max()));
    });
    const NumberLimiter guard(std::max(row.minimum, lowest), std::min(row.maximum, highest), rates);
    std::unique_ptr<IntegralBound> integral;
    for (const IntegralRow& each : schema.integrals) {
      if (each.limit != actuator.first_limit + i) continue;
      integral = std::make_unique<IntegralBound>(each, rates, period);
      has_integrals_ = true;
    }
    const auto rest = row.resting != 0 ? std::optional(row.rest) : std::nullopt;
    numbers_.push_back({i, place.offset, lowest, highest, place.kind, limited || rest,
                        NumberMotion(guard, rest, std::move(integral),
                                     row.minimum > -kUnlimited || row.maximum < kUnlimited)});
  }
}

std::int64_t Motion::propose(const Course& course, const std::byte* desired) noexcept {
  course_ = course;
  const bool first_row = std::exchange(begun_, false);
  // a row begins at the row before it
  if (first_row || !course_.is_row) layout_.copy(from(), desired);
  const std::byte* observed = first_row ? std::exchange(observed_, nullptr) : nullptr;
  starts_observed_ = observed != nullptr;
  if (starts_observed_) layout_.copy_finite(from(), observed);
  if (course_.is_row && course_.profile == Profile::hold) layout_.copy(from(), target());

  std::int64_t longest = std::max<std::int64_t>(1, course.iterations);
  slowest_ = {};
  const bool by_speed = (course_.is_row || numbers_.empty()) && std::isfinite(course.cruise);
  if (by_speed) longest = 1;
  if (by_speed && course.first != StateLayout::kNoNumber) {
    // a row, or a type that blends by itself, at the speed asked for
    constexpr double kPeakFromRest = 1.875;  // of a minimum-jerk motion, to its mean speed
    const double distance =
        layout_.number(course.first, target()) - layout_.number(course.first, from());
    const bool is_smooth = course.profile == Profile::minimum_jerk;
    longest = iterations_of(is_smooth ? kPeakFromRest * distance : distance, course.cruise);
  }
  requested_by_speed_ = longest;
  for (Number& each : numbers_) {
    if (!each.is_commanded || course_.is_row) continue;
    Requested requested = course;
    requested.target = layout_.number(each.number, target());
    requested.line_start = start_of(each);
    if (!first_row) each.motion.begin();
    if (starts_observed_) requested.start = requested.line_start;
    if (each.number != course.first) requested.cruise = kUnlimited;
    const std::int64_t fewest = each.motion.propose(requested);
    if (each.number == course.first) requested_by_speed_ = fewest;
    if (fewest <= longest) continue;
    longest = fewest;
    slowest_ = {each.motion.plan().slowest(), each.number};
  }
  return longest;
}

/// Plans the way of one number to the next row.
void Motion::to_row(Number& number, std::int64_t iterations) noexcept {
  if (starts_observed_) {
    number.motion.start_at(start_of(number));
  } else if (!number.motion.is_planned()) {
    number.motion.start_from({start_of(number)}, false);
  }
  const double row = layout_.number(number.number, target());
  if (course_.profile == Profile::hold) return number.motion.jump_on(row);
  if (course_.profile == Profile::linear) return number.motion.line_on(row, iterations);
  RowsAhead ahead;
  if (course_.next_iterations > 0) {
    ahead = {layout_.number(number.number, course_.next), course_.next_iterations,
             course_.is_first};
    ahead.after =
        course_.after == nullptr ? ahead.next : layout_.number(number.number, course_.after);
  }
  number.motion.curve_on(course_.profile, row, iterations, ahead);
}

/// Types that blend by themselves: by the share of the time, from rest to rest.
void Motion::blend(Iteration now, std::byte* state) noexcept {
  if (now >= last_ || course_.profile == Profile::hold) return layout_.copy(state, target());
  const auto i = static_cast<double>(now - first_ + 1);
  const std::int64_t iterations = last_ - first_ + 1;
  const double share = course_.profile == Profile::minimum_jerk
                           ? SmoothMotion({}, 1.0, iterations).position(i)
                           : i / static_cast<double>(iterations);
  std::byte* blended = target() + stride_;
  layout_.hooks().blend(blended, from(), target(), share);
  // a blend() that divides by zero gives an invalid state: keep the last one
  const bool is_finite = layout_.first_not_finite(blended) == StateLayout::kNoNumber;
  if (is_finite && layout_.proper(blended)) layout_.copy(state, blended);
}

Limited Motion::step(Iteration now, std::byte* state) noexcept {
  Limited result;
  if (layout_.hooks().blend != nullptr) {
    blend(now, state);
    return result;
  }
  for (const std::uint32_t i : switches_) {
    const NumberPlace& place = layout_.numbers()[i];
    std::memcpy(state + place.offset, target() + place.offset, place.size);
  }
  const bool over = now >= last_;
  off_plan_ = 0.0;
  for (Number& each : numbers_) {
    if (!each.is_commanded) {
      each.motion.brake();
      if (each.is_limited) publish(each, state);
      continue;
    }
    const Limit limit = each.motion.step(each.lowest, each.highest);
    const bool first = limit != Limit::none && result.limit == Limit::none;
    if (first || limit >= Limit::below_integral) result = {limit, each.number};
    if (limit != Limit::none) off_plan_ = std::max(off_plan_, each.motion.off_plan());
    if (over && each.motion.arrived()) {
      clear_sign_of_zero(target() + each.offset, each.kind);
      copy_number(state + each.offset, target() + each.offset, layout_.numbers()[each.number].size);
    } else if (each.kind == Kind::float64) {
      store(state + each.offset, each.motion.position() + 0.0);
    } else {
      publish(each, state);
    }
  }
  return result;
}

/// Writes one number to the state, rounded to its kind, inward at its bounds. Integers that a
/// double cannot hold stay exact on a line without limits.
void Motion::publish(const Number& number, std::byte* state) noexcept {
  std::byte* at = state + number.offset;
  const double value = number.motion.position();
  // a number outside its bounds may stay there
  const double low = std::min(number.motion.guard().minimum(), value);
  const double high = std::max(number.motion.guard().maximum(), value);
  visit_number(number.kind, [&]<class T>(T) {
    if constexpr (std::is_floating_point_v<T>) {
      const bool is_cut = sizeof(T) < 8 && number.is_limited;
      store(at, static_cast<T>((is_cut ? nearest_float(value, low, high) : value) + 0.0));
    } else if (sizeof(T) < 8 || number.is_limited || !number.motion.is_on_line()) {
      store(at, to_integer<T>(number.is_limited ? nearest_whole(value, low, high) : value));
    } else {
      const auto start = static_cast<long double>(load<T>(from() + number.offset));
      const auto end = static_cast<long double>(load<T>(target() + number.offset));
      const auto share = static_cast<long double>(number.motion.plan().share());
      store(at, to_integer<T>(start + (end - start) * share));
    }
  });
}

}  // namespace o80
