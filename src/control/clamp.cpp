#include "o80/control/clamp.hpp"

#include <cmath>
#include <limits>

namespace o80 {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();
// what interpolation rounds is no excess of speed
constexpr double kRounding = 1e-9;

bool is_float(Kind kind) noexcept { return kind == Kind::float64 || kind == Kind::float32; }

template <class T>
void store_integer(std::byte* at, double value) noexcept {
  using Range = std::numeric_limits<T>;
  const T whole = value <= static_cast<double>(Range::min())   ? Range::min()
                  : value >= static_cast<double>(Range::max()) ? Range::max()
                                                               : static_cast<T>(value);
  std::memcpy(at, &whole, sizeof whole);
}

/// Writes a limit, rounded towards the inside of its range.
void store_limit(std::byte* at, Kind kind, double value, bool downwards) noexcept {
  const double whole = downwards ? std::floor(value) : std::ceil(value);
  switch (kind) {
    case Kind::float64:
      std::memcpy(at, &value, sizeof value);
      break;
    case Kind::float32: {
      auto narrow = static_cast<float>(value);
      if (downwards ? narrow > value : narrow < value) {
        narrow = std::nextafter(narrow, downwards ? -HUGE_VALF : HUGE_VALF);
      }
      std::memcpy(at, &narrow, sizeof narrow);
      break;
    }
    case Kind::int8:
      store_integer<std::int8_t>(at, whole);
      break;
    case Kind::int16:
      store_integer<std::int16_t>(at, whole);
      break;
    case Kind::int32:
      store_integer<std::int32_t>(at, whole);
      break;
    case Kind::int64:
      store_integer<std::int64_t>(at, whole);
      break;
    case Kind::uint8:
      store_integer<std::uint8_t>(at, whole);
      break;
    case Kind::uint16:
      store_integer<std::uint16_t>(at, whole);
      break;
    case Kind::uint32:
      store_integer<std::uint32_t>(at, whole);
      break;
    case Kind::uint64:
      store_integer<std::uint64_t>(at, whole);
      break;
    default:
      break;
  }
}

}  // namespace

Clamp::Clamp(const Schema& schema, const ActuatorRow& actuator, const StateLayout& layout)
    : layout_(layout) {
  const double period = static_cast<double>(schema.head.period) / 1e9;
  for (std::uint32_t i = 0; i < layout.numbers().size() && i < actuator.limits; ++i) {
    const NumberPlace& place = layout.numbers()[i];
    const LimitRow& row = schema.limits.at(actuator.first_limit + i);
    Limit limit{i, row.minimum, row.maximum, row.speed >= 0.0 ? row.speed * period : kNone};
    // an integer moves by one or not at all
    if (!is_float(place.kind)) limit.step = std::ceil(limit.step);
    const bool bounded = limit.minimum > -kNone || limit.maximum < kNone || limit.step < kNone;
    if (place.moves() && bounded) limits_.push_back(limit);
  }
}

bool Clamp::apply(std::byte* state, const std::byte* previous) const noexcept {
  bool clamped = false;
  for (const Limit& limit : limits_) {
    const NumberPlace& place = layout_.numbers()[limit.number];
    std::byte* at = state + place.offset;
    double value = layout_.number(limit.number, state);
    const auto give_way = [&](double allowed, bool downwards) {
      store_limit(at, place.kind, allowed, downwards);
      value = layout_.number(limit.number, state);
      clamped = true;
    };
    if (value < limit.minimum) give_way(limit.minimum, false);
    if (value > limit.maximum) give_way(limit.maximum, true);
    if (!(limit.step < kNone)) continue;

    const double before = layout_.number(limit.number, previous);
    const double rounding = place.kind == Kind::float32 ? std::numeric_limits<float>::epsilon()
                                                        : std::numeric_limits<double>::epsilon();
    const double slack =
        kRounding * limit.step + 4.0 * rounding * std::fmax(std::abs(value), std::abs(before));
    if (value > before + limit.step + slack) {
      give_way(before + limit.step, true);
    } else if (value < before - limit.step - slack) {
      give_way(before - limit.step, false);
    }
  }
  return clamped;
}

}  // namespace o80
