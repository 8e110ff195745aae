#include "control/layouts_of_types.hpp"

#include <cmath>
#include <string>

#include "o80/base/error.hpp"

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

std::vector<std::optional<StateLayout>> layouts_of_types(const Schema& schema) {
  std::vector<std::optional<StateLayout>> layouts(schema.types.size());
  for (const ActuatorRow& actuator : schema.actuators) {
    auto& layout = layouts.at(actuator.type);
    if (!layout) layout.emplace(schema, actuator.type);
    if (layout->numbers().empty()) {
      throw InvalidArgument("actuator '" + actuator.name.str() +
                            "' has a state without numbers: describe at least one field of '" +
                            schema.types[actuator.type].name.str() + "'");
    }
    if (layout->hooks().blend != nullptr) refuse_limits(schema, actuator);
    if (actuator.offset + layout->size() > schema.head.block) {
      throw InvalidArgument("actuator '" + actuator.name.str() +
                            "' lies outside the robot's block of " +
                            std::to_string(schema.head.block) + " bytes");
    }
  }
  for (const RequestRow& request : schema.requests) {
    if (request.type == kNoType) continue;
    auto& layout = layouts.at(request.type);
    if (!layout) layout.emplace(schema, request.type);
  }
  return layouts;
}

}  // namespace o80
