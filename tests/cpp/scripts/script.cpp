#include "scripts/script.hpp"

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

namespace o80::test {
namespace {

template <class T>
void store_integer_as(double value, std::byte* at) {
  using Range = std::numeric_limits<T>;
  const double whole = std::round(value);
  T stored = 0;
  if (whole >= static_cast<double>(Range::max())) {
    stored = Range::max();
  } else if (whole <= static_cast<double>(Range::min())) {
    stored = Range::min();
  } else if (whole == whole) {
    stored = static_cast<T>(whole);
  }
  std::memcpy(at, &stored, sizeof stored);
}

template <class T>
long double loaded(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return static_cast<long double>(value);
}

struct Polar {
  double angle;
  double radius;
};

/// An angle goes the shorter way round.
void blend_polar(void* out, const void* from, const void* to, double share) {
  const auto* a = static_cast<const Polar*>(from);
  const auto* b = static_cast<const Polar*>(to);
  const double turn = std::remainder(b->angle - a->angle, 2.0 * std::numbers::pi);
  auto* result = static_cast<Polar*>(out);
  result->angle = a->angle + turn * share;
  result->radius = a->radius + (b->radius - a->radius) * share;
}

}  // namespace

bool NumberSpec::bounded() const {
  return std::isfinite(limits.minimum) || std::isfinite(limits.maximum);
}

bool NumberSpec::limited() const { return bounded() || std::isfinite(limits.speed); }

std::uint32_t bytes_of_kind(Kind kind) { return kind == Kind::enumeration ? 1 : size_of(kind); }

void store_as(Kind kind, double value, std::byte* at) {
  switch (kind) {
    case Kind::float64:
      std::memcpy(at, &value, sizeof value);
      return;
    case Kind::float32: {
      constexpr double kMax = std::numeric_limits<float>::max();
      const auto narrow = static_cast<float>(
          std::isfinite(value) ? std::fmin(std::fmax(value, -kMax), kMax) : value);
      std::memcpy(at, &narrow, sizeof narrow);
      return;
    }
    case Kind::int8:
      return store_integer_as<std::int8_t>(value, at);
    case Kind::int16:
      return store_integer_as<std::int16_t>(value, at);
    case Kind::int32:
      return store_integer_as<std::int32_t>(value, at);
    case Kind::int64:
      return store_integer_as<std::int64_t>(value, at);
    case Kind::uint16:
      return store_integer_as<std::uint16_t>(value, at);
    case Kind::uint32:
      return store_integer_as<std::uint32_t>(value, at);
    case Kind::uint64:
      return store_integer_as<std::uint64_t>(value, at);
    case Kind::boolean:
      return store_integer_as<std::uint8_t>(value >= 0.5 ? 1.0 : 0.0, at);
    case Kind::enumeration:  // labels 0, 1 and 2
      return store_integer_as<std::uint8_t>(std::fmin(value, 2.0), at);
    default:
      return store_integer_as<std::uint8_t>(value, at);
  }
}

long double load_as(Kind kind, const std::byte* at) {
  switch (kind) {
    case Kind::float64:
      return loaded<double>(at);
    case Kind::float32:
      return loaded<float>(at);
    case Kind::int8:
      return loaded<std::int8_t>(at);
    case Kind::int16:
      return loaded<std::int16_t>(at);
    case Kind::int32:
      return loaded<std::int32_t>(at);
    case Kind::int64:
      return loaded<std::int64_t>(at);
    case Kind::uint16:
      return loaded<std::uint16_t>(at);
    case Kind::uint32:
      return loaded<std::uint32_t>(at);
    case Kind::uint64:
      return loaded<std::uint64_t>(at);
    default:
      return loaded<std::uint8_t>(at);
  }
}

Schema Script::schema() const {
  Schema schema;
  schema.head.robot = NameText("script");
  schema.head.period = 1'000'000;
  for (const char* name : {"none", "one", "two"}) {
    LabelRow label;
    label.name = NameText(name);
    label.value = static_cast<std::int64_t>(schema.labels.size());
    schema.labels.push_back(label);
  }
  for (std::size_t a = 0; a < actuators.size(); ++a) {
    const ActuatorSpec& spec = actuators[a];
    std::vector<FieldRow> fields;
    for (std::size_t n = 0; n < spec.numbers.size(); ++n) {
      FieldRow field = scalar_field("x" + std::to_string(n), spec.numbers[n].kind);
      field.size = bytes_of_kind(spec.numbers[n].kind);
      if (spec.numbers[n].kind == Kind::enumeration) field.labels = 3;
      field.resting = spec.numbers[n].resting ? 1 : 0;
      field.rest = spec.numbers[n].rest;
      fields.push_back(field);
    }
    const auto type = schema.add_type("State" + std::to_string(a), std::move(fields));
    if (spec.blend) schema.hooks[type].blend = blend_polar;
    schema.add_actuators("actuator" + std::to_string(a), type, 1, false);
    schema.actuator(static_cast<std::uint32_t>(a))
        .when_idle(spec.follow ? WhenIdle::follow : WhenIdle::hold);
    for (std::size_t n = 0; n < spec.numbers.size(); ++n) {
      schema.actuator(static_cast<std::uint32_t>(a))
          .limits("x" + std::to_string(n), spec.numbers[n].limits);
    }
  }
  return schema;
}

}  // namespace o80::test
