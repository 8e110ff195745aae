#include "control/limiter.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include "describe/visit_number.hpp"

namespace o80 {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
// relative tolerance between a step of the limiter and of its motion
constexpr double kStepRounding = 1e-9;

template <class T>
void store_integer(std::byte* at, double value) noexcept {
  using Range = std::numeric_limits<T>;
  const T whole = value <= static_cast<double>(Range::min())   ? Range::min()
                  : value >= static_cast<double>(Range::max()) ? Range::max()
                                                               : static_cast<T>(value);
  std::memcpy(at, &whole, sizeof whole);
}

void store_double(std::byte* at, double value) noexcept { std::memcpy(at, &value, sizeof value); }

/// Range of the values of a kind. It also bounds the motion to rest.
std::pair<double, double> range_of(Kind kind) noexcept {
  return visit_number(kind, []<class T>(T) {
    using Range = std::numeric_limits<T>;
    return std::pair(static_cast<double>(Range::lowest()), static_cast<double>(Range::max()));
  });
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

Limiter::Limiter(const Schema& schema, const ActuatorRow& actuator, const StateLayout& layout)
    : layout_(layout) {
  const double period = static_cast<double>(schema.head.period) / 1e9;
  for (std::uint32_t i = 0; i < layout.numbers().size() && i < actuator.limits; ++i) {
    const LimitRow& row = schema.limits.at(actuator.first_limit + i);
    const Rates rates{row.speed * period, row.acceleration * period * period,
                      row.jerk * period * period * period};
    const bool limited =
        row.minimum > -kUnlimited || row.maximum < kUnlimited || rates.speed < kUnlimited;
    if (!layout.numbers()[i].moves() || !(limited || row.resting != 0)) continue;
    const auto [lowest, highest] = range_of(layout.numbers()[i].kind);
    numbers_.push_back(
        {i,
         NumberLimiter(std::max(row.minimum, lowest), std::min(row.maximum, highest), rates),
         row.resting != 0 ? std::optional(row.rest) : std::nullopt,
         {},
         lowest,
         highest,
         layout.numbers()[i].offset,
         layout.numbers()[i].kind == Kind::float64 && layout.hooks().blend == nullptr});
  }
}

void Limiter::restart(const std::byte* state) noexcept {
  release();
  for (Number& each : numbers_) each.limiter.restart(layout_.number(each.number, state));
}

void Limiter::begin() noexcept {
  for (Number& each : numbers_) each.limiter.begin();
}

/// Writes one number to the state, rounded to its kind.
void Limiter::publish(const Number& number, std::byte* state) const noexcept {
  if (number.is_double) return store_double(state + number.offset, number.limiter.position());
  const NumberPlace& place = layout_.numbers()[number.number];
  std::byte* at = state + place.offset;
  const double value = number.limiter.position();
  // a number outside its bounds may stay there
  const double low = std::min(number.limiter.minimum(), value);
  const double high = std::max(number.limiter.maximum(), value);
  visit_number(place.kind, [&]<class T>(T) {
    if constexpr (std::is_integral_v<T>) {
      store_integer<T>(at, nearest_whole(value, low, high));
    } else {
      const auto exact = static_cast<T>(sizeof(T) < 8 ? nearest_float(value, low, high) : value);
      std::memcpy(at, &exact, sizeof exact);
    }
  });
}

/// One iteration towards rest; true while it moves.
bool Limiter::Number::brake() noexcept {
  const double before = limiter.position();
  const bool was_away = away();
  if (was_away) {
    limiter.follow(*rest);
  } else if (!limiter.at_rest()) {
    limiter.brake();
  }
  return was_away || limiter.position() != before || !limiter.at_rest();
}

/// Brakes a number that the present command does not move.
void Limiter::leave_out(Number& number, std::byte* state) noexcept {
  number.brake();
  publish(number, state);
}

Limited Limiter::follow(const Motion& motion, std::byte* state, const std::uint64_t* mask,
                        std::uint32_t one, double most) noexcept {
  Limited result;
  const bool arrived = motion.arrived();
  for (Number& each : numbers_) {
    if (!masked(mask, each.number)) {
      leave_out(each, state);
      continue;
    }
    const double speed = each.number == one ? most : kUnlimited;
    // rounding of the motion may leave the range of the kind
    const double moved =
        each.is_double ? load<double>(state + each.offset) : motion.number(each.number);
    const double wanted = std::clamp(moved, each.lowest, each.highest);
    const Limit limit = each.limiter.follow(wanted, speed);
    // `state` already holds the exact target
    if (limit == Limit::none && arrived) continue;
    publish(each, state);
    if (limit != Limit::none && result.limit == Limit::none) result = {limit, each.number};
  }
  return result;
}

Limited Limiter::follow(std::byte* state) noexcept {
  Limited result;
  for (Number& each : numbers_) {
    const double wanted =
        each.is_double ? load<double>(state + each.offset) : layout_.number(each.number, state);
    const Limit limit = each.limiter.follow(wanted);
    if (limit == Limit::none) continue;
    publish(each, state);
    if (result.limit == Limit::none) result = {limit, each.number};
  }
  return result;
}

bool Limiter::brake(std::byte* state) noexcept {
  bool moves = false;
  for (Number& each : numbers_) {
    const double before = each.limiter.position();
    moves = each.brake() || moves;
    if (each.limiter.position() != before) publish(each, state);
  }
  return moves;
}

bool Limiter::brake_resting(std::byte* state) noexcept {
  bool moves = false;
  for (Number& each : numbers_) {
    if (each.rest) {
      moves = each.brake() || moves;
      publish(each, state);
    } else {
      each.limiter.restart(layout_.number(each.number, state));
    }
  }
  return moves;
}

void Limiter::hold(const std::uint64_t* mask) noexcept {
  for (Number& each : numbers_) each.held = each.rest.has_value() && masked(mask, each.number);
}

void Limiter::release() noexcept {
  for (Number& each : numbers_) each.held = false;
}

void Limiter::keep_moving(Motion& motion, const std::byte* state,
                          const Number& number) const noexcept {
  const NumberLimiter& limiter = number.limiter;
  if (!std::isfinite(limiter.rates().acceleration)) {
    return motion.keep_moving(state, number.number, {}, limiter.position(), 0);
  }
  // a Fading motion (a cubic velocity) within the limits needs twice the time and distance of the
  // shortest stop
  const VelocityChange stop(-limiter.speed(), limiter.acceleration(), limiter.rates());
  const double place = std::clamp(limiter.position() + 2.0 * stop.displacement(),
                                  std::min(limiter.minimum(), limiter.position()),
                                  std::max(limiter.maximum(), limiter.position()));
  motion.keep_moving(state, number.number, {limiter.speed(), limiter.acceleration()}, place,
                     2 * stop.steps());
}

void Limiter::keep_lagging(Motion& motion, const std::byte* state) const noexcept {
  for (const Number& each : numbers_) {
    // a number that a bound has held back moves slower than its motion
    const bool held_back = !std::isfinite(each.limiter.rates().acceleration) &&
                           std::abs(each.limiter.speed()) <
                               std::abs(motion.kept_step(each.number)) * (1.0 - kStepRounding);
    if (!each.limiter.tracks() || each.planned || held_back) keep_moving(motion, state, each);
  }
}

void Limiter::hand_over(Motion& motion, const std::byte* state) const noexcept {
  for (const Number& each : numbers_) {
    motion.start_at(each.number, each.limiter.position());
    if (!each.limiter.at_rest()) keep_moving(motion, state, each);
  }
}

std::int64_t Limiter::plan_fastest(const std::byte* target, const std::uint64_t* mask) noexcept {
  std::int64_t longest = 1;
  for (Number& each : numbers_) {
    const NumberLimiter& limiter = each.limiter;
    each.planned = masked(mask, each.number) && std::isfinite(limiter.rates().acceleration);
    if (!each.planned) continue;
    each.fastest = FastestMotion(limiter.position(), limiter.speed(), limiter.acceleration(),
                                 layout_.number(each.number, target), limiter.rates());
    longest = std::max(longest, each.fastest.iterations());
  }
  stretch_fastest(longest);
  return longest;
}

void Limiter::stretch_fastest(std::int64_t iterations) noexcept {
  for (Number& each : numbers_) {
    if (each.planned) each.fastest.stretch(iterations);
  }
}

Limited Limiter::follow_fastest(std::byte* state) noexcept {
  Limited result;
  for (Number& each : numbers_) {
    if (!each.planned) {
      leave_out(each, state);
      continue;
    }
    const Limit limit = each.limiter.follow(each.fastest.next());
    publish(each, state);
    if (limit != Limit::none && result.limit == Limit::none) result = {limit, each.number};
  }
  return result;
}

}  // namespace o80
