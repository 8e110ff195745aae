#include "control/motion/state_layout.hpp"

#include <algorithm>
#include <bit>
#include <string>

namespace o80 {
namespace {

/// Throws if an actuator has limits or rest values: they apply to single numbers, which a type with
/// its own blend() does not interpolate one by one.
void refuse_limits(const Schema& schema, const ActuatorRow& actuator) {
  for (std::uint32_t i = 0; i < actuator.limits; ++i) {
    const LimitRow& limit = schema.limits.at(actuator.first_limit + i);
    const bool limited = std::isfinite(limit.minimum) || std::isfinite(limit.maximum) ||
                         std::isfinite(limit.speed);  // the other limits need one of speed
    if (limited || limit.resting != 0) {
      const std::string type =
          ", but its type '" + schema.types[actuator.type].name.str() + "' has its own blend(): ";
      throw InvalidArgument("actuator '" + actuator.name.str() + "' has " +
                            (limited ? "limits" + type + "limit it in the driver"
                                     : "a rest value" + type + "bring it to rest in the driver"));
    }
  }
}

}  // namespace

StateLayout::StateLayout(const Schema& schema, std::uint32_t type)
    : hooks_(type < schema.hooks.size() ? schema.hooks[type] : TypeHooks{}),
      size_(schema.types.at(type).size) {
  std::uint32_t end = 0;
  schema.each_scalar(type, [&](std::uint32_t offset, const FieldRow& field) {
    const std::uint32_t size = field.kind == Kind::enumeration ? field.size : size_of(field.kind);
    if ((size != 1 && size != 2 && size != 4 && size != 8) || offset + size > size_) {
      throw InvalidArgument("field '" + field.name.str() + "' of '" +
                            schema.types[type].name.str() +
                            "' must be a number, a boolean or an enumeration");
    }
    NumberPlace place{.offset = offset, .size = size, .kind = field.kind};
    if (field.kind == Kind::enumeration) {
      const auto narrowest = static_cast<int>(field.is_signed != 0 ? Kind::int8 : Kind::uint8);
      place.integer = static_cast<Kind>(narrowest + std::countr_zero(size));
      place.first_label = static_cast<std::uint32_t>(labels_.size());
      place.labels = field.labels;
      for (std::uint32_t i = 0; i < field.labels; ++i) {
        labels_.push_back(schema.labels.at(field.first_label + i).value);
      }
    }
    plain_ = plain_ && field.kind == Kind::float64 && offset == end;
    padded_ = padded_ || offset != end;
    end = offset + size;
    numbers_.push_back(place);
  });
  padded_ = padded_ || end != size_;
  plain_ = plain_ && end == size_;
}

bool StateLayout::same(const std::byte* one, const std::byte* other,
                       const std::uint64_t* mask) const noexcept {
  if (mask == nullptr && !padded_) return std::memcmp(one, other, size_) == 0;
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const NumberPlace& place = numbers_[i];
    if (masked(mask, i) && std::memcmp(one + place.offset, other + place.offset, place.size) != 0) {
      return false;
    }
  }
  return true;
}

void StateLayout::copy_finite(std::byte* to, const std::byte* from) const noexcept {
  if (plain_) {
    for (std::uint32_t at = 0; at < size_; at += sizeof(double)) {
      if (!std::isfinite(load<double>(from + at))) continue;
      std::memcpy(to + at, from + at, sizeof(double));
      clear_sign_of_zero(to + at, Kind::float64);
    }
    return;
  }
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    if (!finite_number(i, from)) continue;
    copy_number(to + numbers_[i].offset, from + numbers_[i].offset, numbers_[i].size);
    clear_sign_of_zero(to + numbers_[i].offset, numbers_[i].kind);
  }
}

bool StateLayout::proper_number(std::size_t number, const std::byte* state) const noexcept {
  const NumberPlace& place = numbers_[number];
  const std::byte* at = state + place.offset;
  if (place.kind == Kind::boolean) return load<std::uint8_t>(at) <= 1;
  if (place.kind != Kind::enumeration || place.labels == 0) return true;
  const std::int64_t value = visit_number(
      place.integer, [&]<class T>(T) { return static_cast<std::int64_t>(load<T>(at)); });
  const auto first = labels_.begin() + place.first_label;
  return std::find(first, first + place.labels, value) != first + place.labels;
}

const StateLayout& layout_of(const Schema& schema, std::uint32_t type, Layouts& layouts) {
  auto& layout = layouts.at(type);
  return layout ? *layout : layout.emplace(schema, type);
}

Layouts layouts_of_types(const Schema& schema, bool controlled) {
  Layouts layouts(schema.types.size());
  for (const ActuatorRow& actuator : schema.actuators) {
    const StateLayout& layout = layout_of(schema, actuator.type, layouts);
    if (!controlled) continue;
    if (layout.numbers().empty()) {
      throw InvalidArgument("actuator '" + actuator.name.str() +
                            "' has a state without numbers: describe at least one field of '" +
                            schema.types[actuator.type].name.str() + "'");
    }
    if (layout.hooks().blend != nullptr) refuse_limits(schema, actuator);
    if (actuator.offset + layout.size() > schema.head.block) {
      throw InvalidArgument("actuator '" + actuator.name.str() +
                            "' lies outside the robot's block of " +
                            std::to_string(schema.head.block) + " bytes");
    }
  }
  for (const RequestRow& request : schema.requests) {
    if (request.type != kNoType) layout_of(schema, request.type, layouts);
  }
  return layouts;
}

}  // namespace o80
