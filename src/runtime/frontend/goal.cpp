#include "runtime/frontend/goal.hpp"

#include <algorithm>
#include <cmath>

#include "base/short_text.hpp"
#include "control/batch/record.hpp"
#include "o80/base/nearest_name.hpp"

namespace o80 {

namespace {

/// Name and unit of each number of a state.
std::vector<std::pair<std::string, std::string>> numbers_of(const Schema& schema,
                                                            std::uint32_t type) {
  std::vector<std::pair<std::string, std::string>> numbers;
  const FieldRow* before = nullptr;
  std::uint32_t element = 0;
  schema.each_scalar(type, [&](std::uint32_t, const FieldRow& field) {
    element = &field == before ? element + 1 : 0;
    before = &field;
    const std::string index = field.rows == 0 ? "" : "[" + std::to_string(element) + "]";
    numbers.emplace_back(field.name.str() + index, field.unit.str());
  });
  return numbers;
}

[[noreturn]] void refuse_tolerance(const Miss& miss, const char* why) {
  throw InvalidArgument("the tolerance of " +
                        (miss.field.empty() ? "" : "'" + miss.field + "' of ") + "actuator '" +
                        miss.actuator + "' " + why);
}

std::string text_of(double value, const std::string& unit) {
  ShortText<40> text;
  text.add(value);
  return std::string(text.view()) + (unit.empty() ? "" : " " + unit);
}

}  // namespace

Move::Goal::Goal(const Schema& schema, std::span<const std::uint32_t> actuators,
                 std::span<const std::byte> states, std::span<const std::uint64_t> masks,
                 const MoveOptions& options) {
  std::size_t given = 0;  // tolerances used
  for (const std::uint32_t index : actuators) {
    const ActuatorRow& actuator = schema.actuators[index];
    const StateLayout layout(schema, actuator.type);
    const auto names = numbers_of(schema, actuator.type);
    const std::uint64_t* const mask = masks.empty() ? nullptr : masks.data();
    for (std::size_t i = 0; i < names.size(); ++i) {
      Miss miss{.actuator = actuator.name.str(), .field = names[i].first, .unit = names[i].second};
      miss.tolerance = options.tolerance;
      if (!options.tolerances.empty()) {
        if (given == options.tolerances.size()) refuse_tolerance(miss, "is missing");
        miss.tolerance = options.tolerances[given++];
      }
      const bool is_commanded = masked(mask, i);
      if (miss.tolerance == std::numeric_limits<double>::infinity()) {
        if (!options.tolerances.empty()) continue;
      } else if (!is_commanded && !options.tolerances.empty()) {
        refuse_tolerance(miss, "is given, but no target");
      }
      if (!is_commanded) continue;
      if (!(miss.tolerance >= 0) || !std::isfinite(miss.tolerance)) {
        refuse_tolerance(miss, "must be given, finite and not negative");
      }
      miss.target = layout.number(i, states.data());
      judged_.push_back({layout, i, actuator.offset, miss});
    }
    states = states.subspan(layout.size());
    if (!masks.empty()) masks = masks.subspan(mask_words(static_cast<std::uint32_t>(names.size())));
  }
  if (given != options.tolerances.size()) {
    throw InvalidArgument("there are " + std::to_string(options.tolerances.size()) +
                          " tolerances for " + std::to_string(given) +
                          " numbers: give one for each number of each actuator");
  }
}

std::vector<Miss> Move::Goal::misses(const UntypedObservation& row) const {
  std::vector<Miss> misses;
  for (const Judged& each : judged_) {
    Miss miss = each.miss;
    miss.observed = each.layout.number(each.number, row.observed() + each.offset);
    miss.distance = std::abs(miss.observed - miss.target);
    // booleans and enumerations must be equal; a NaN is never within
    const double most = each.layout.numbers()[each.number].moves() ? miss.tolerance : 0.0;
    if (!(miss.distance <= most)) misses.push_back(std::move(miss));
  }
  return misses;
}

std::string not_reached_text(const std::string& segment, const std::vector<Miss>& misses,
                             const Batch& batch, Timeout timeout) {
  std::string text = "'" + segment + "' was not at its targets";
  if (timeout) {
    text += " within " + text_of(std::chrono::duration<double>(*timeout).count(), "s");
  }
  std::vector<std::string> each;
  each.reserve(misses.size());
  for (const Miss& miss : misses) {
    each.push_back((miss.field.empty() ? "" : miss.field + " of ") + "'" + miss.actuator +
                   "' is observed at " + text_of(miss.observed, miss.unit) + ", " +
                   text_of(miss.distance, miss.unit) + " from its target of " +
                   text_of(miss.target, miss.unit) + " (tolerance " +
                   text_of(miss.tolerance, miss.unit) + ")");
  }
  text += ": " + first_names(each, "; ", "; and ");
  const bool ended = batch.ended();
  if (!misses.empty()) text += ". ";
  text += ended ? "Its command has completed" : "Its command has not ended and continues";
  return text + (ended ? ": pass a longer timeout or a larger tolerance, or see what keeps the "
                         "robot from its target"
                       : ": pass a longer timeout, or purge it");
}

}  // namespace o80
