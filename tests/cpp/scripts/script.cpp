#include "scripts/script.hpp"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <type_traits>

#include "describe/visit_number.hpp"

namespace o80::test {
namespace {

template <class T>
T rounded_to(double value) {
  using Range = std::numeric_limits<T>;
  if constexpr (std::is_floating_point_v<T>) {
    constexpr auto kMax = static_cast<double>(Range::max());
    return static_cast<T>(std::isfinite(value) ? std::fmin(std::fmax(value, -kMax), kMax) : value);
  } else {
    const double whole = std::round(value);
    if (whole >= static_cast<double>(Range::max())) return Range::max();
    if (whole <= static_cast<double>(Range::min())) return Range::min();
    return whole == whole ? static_cast<T>(whole) : T{0};
  }
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
  if (kind == Kind::boolean) value = value >= 0.5 ? 1.0 : 0.0;
  if (kind == Kind::enumeration) value = std::fmin(value, 2.0);  // labels 0, 1 and 2
  visit_number(kind, [&]<class T>(T) {
    const T stored = rounded_to<T>(value);
    std::memcpy(at, &stored, sizeof stored);
  });
}

long double load_as(Kind kind, const std::byte* at) {
  return visit_number(kind, [&]<class T>(T) {
    T value;
    std::memcpy(&value, at, sizeof value);
    return static_cast<long double>(value);
  });
}

long double as_stored(Kind kind, double value) {
  std::array<std::byte, 8> bytes{};
  store_as(kind, value, bytes.data());
  return load_as(kind, bytes.data());
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
