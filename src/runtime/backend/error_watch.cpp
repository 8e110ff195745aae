#include "runtime/backend/error_watch.hpp"

#include <cmath>

#include "describe/number_name.hpp"

namespace o80 {

ErrorWatch::ErrorWatch(const Schema& schema) : layouts_(schema.types.size()) {
  for (std::uint32_t i = 0; i < schema.actuators.size(); ++i) {
    const ActuatorRow& row = schema.actuators[i];
    for (std::uint32_t number = 0; number < row.limits; ++number) {
      const double limit = schema.limits[row.first_limit + number].error;
      if (!std::isfinite(limit)) continue;
      layout_of(schema, row.type, layouts_);
      watched_.push_back({i, number, row.offset, row.type, limit});
    }
  }
}

std::optional<ErrorWatch::Excess> ErrorWatch::find(const std::byte* desired,
                                                   const std::byte* observed) const noexcept {
  for (const Watched& each : watched_) {
    const StateLayout& layout = *layouts_[each.type];
    const double wanted = layout.number(each.number, desired + each.offset);
    const double found = layout.number(each.number, observed + each.offset);
    // `<=`, because a comparison with NaN is false: NaN must count as an excess
    if (std::abs(wanted - found) <= each.limit) continue;
    return Excess{each.actuator, each.number, wanted, found, each.limit};
  }
  return std::nullopt;
}

void describe_excess(const Schema& schema, const ErrorWatch::Excess& excess,
                     ShortText<248>& text) noexcept {
  name_number(schema, excess.actuator, excess.number, text);
  text.add(" is observed at ").add(excess.observed).add(", desired at ").add(excess.desired);
  text.add(": further apart than its error limit of ").add(excess.limit);
}

}  // namespace o80
