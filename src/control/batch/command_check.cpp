#include "control/batch/command_check.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>

#include "base/short_text.hpp"
#include "describe/number_name.hpp"
#include "describe/visit_number.hpp"
#include "o80/base/nearest_name.hpp"

namespace o80 {
namespace {

std::string text_of(double value) {
  if (std::isnan(value)) return "nan";  // its sign means nothing
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return std::string(text, end);
}

std::string with_unit(const std::string& text, const FieldRow* field) {
  if (field == nullptr || field->unit.view().empty()) return text;
  return text + " [" + field->unit.str() + "]";
}

std::string of_actuator(const Schema& schema, std::uint32_t actuator) {
  return "actuator '" + schema.actuators[actuator].name.str() + "' (" + std::to_string(actuator) +
         ")";
}

std::string of_number(const Schema& schema, std::uint32_t actuator, const NumberName& name) {
  return (name.path.empty() ? "" : "'" + name.path + "' of ") + of_actuator(schema, actuator);
}

template <class Row>
std::vector<std::string> names_of(const std::vector<Row>& rows) {
  std::vector<std::string> names(rows.size());
  std::ranges::transform(rows, names.begin(), [](const Row& row) { return row.name.str(); });
  return names;
}

const std::uint64_t* bits_of(std::span<const std::uint64_t> mask) {
  return mask.empty() ? nullptr : mask.data();
}

std::string labels_of(const Schema& schema, const FieldRow& field) {
  if (field.kind == Kind::boolean) return "0, 1";
  std::vector<std::string> labels;
  for (std::uint32_t i = 0; i < field.labels; ++i) {
    const LabelRow& label = schema.labels.at(field.first_label + i);
    labels.push_back(label.name.str() + " (" + std::to_string(label.value) + ")");
  }
  return first_names(labels);
}

}  // namespace

Profile usual_profile(const Schema& schema, const ActuatorRow& actuator) noexcept {
  const auto limits = std::span(schema.limits).subspan(actuator.first_limit, actuator.limits);
  const bool accelerates = std::ranges::any_of(
      limits, [](const LimitRow& limit) { return std::isfinite(limit.acceleration); });
  return accelerates ? Profile::minimum_jerk : Profile::linear;
}

TargetLimits::TargetLimits(const Schema& schema, const Layouts& layouts) {
  constexpr double kLargest = std::numeric_limits<double>::max();
  for (const ActuatorRow& row : schema.actuators) {
    Actuator& actuator = actuators_.emplace_back(Actuator{&*layouts.at(row.type), {}});
    for (std::uint32_t i = 0; i < row.limits; ++i) {
      const LimitRow& limit = schema.limits.at(row.first_limit + i);
      const bool moves = actuator.layout->numbers()[i].moves();
      actuator.ranges.push_back({std::fmax(limit.minimum, -kLargest),
                                 std::fmin(limit.maximum, kLargest),
                                 !moves || std::isfinite(limit.acceleration)});
    }
  }
}

bool TargetLimits::admit(std::uint32_t actuator, const std::byte* state,
                         const std::uint64_t* mask) const noexcept {
  const StateLayout& layout = *actuators_[actuator].layout;
  const Range* ranges = actuators_[actuator].ranges.data();
  const std::size_t numbers = layout.numbers().size();
  if (layout.plain() && mask == nullptr) {
    bool all = true;
    for (std::size_t i = 0; i < numbers; ++i) {
      const double value = load<double>(state + i * sizeof(double));
      all = all && value >= ranges[i].lowest && value <= ranges[i].highest;
    }
    return all;
  }
  for (std::size_t i = 0; i < numbers; ++i) {
    if (!masked(mask, i)) continue;
    if (!layout.proper_number(i, state)) return false;
    if (!layout.numbers()[i].moves()) continue;
    const double value = layout.number(i, state);
    if (!(value >= ranges[i].lowest && value <= ranges[i].highest)) return false;
  }
  return true;
}

std::size_t TargetLimits::clip(std::uint32_t actuator, std::byte* state,
                               const std::uint64_t* mask) const noexcept {
  const auto& [layout, ranges] = actuators_[actuator];
  std::size_t clipped = 0;
  for (std::uint32_t i = 0; i < ranges.size(); ++i) {
    const NumberPlace& place = layout->numbers()[i];
    if (!masked(mask, i) || !place.moves()) continue;
    const auto [lowest, highest, accelerates] = ranges[i];
    const double value = layout->number(i, state);
    if (!std::isfinite(value) || (value >= lowest && value <= highest)) continue;
    ++clipped;
    visit_number(place.kind, [&]<class T>(T) {
      // rounded inward
      T inside{};
      if constexpr (std::is_floating_point_v<T>) {
        inside = static_cast<T>(std::clamp(value, lowest, highest));
        if (inside > highest) inside = std::nextafter(inside, std::numeric_limits<T>::lowest());
        if (inside < lowest) inside = std::nextafter(inside, std::numeric_limits<T>::max());
      } else {
        inside = static_cast<T>(value < lowest ? std::ceil(lowest) : std::floor(highest));
      }
      std::memcpy(state + place.offset, &inside, sizeof inside);
    });
  }
  return clipped;
}

std::uint32_t CommandCheck::actuator(std::string_view name) const {
  const std::vector<std::string> known = names_of(schema_.actuators);
  const auto found = std::ranges::find(known, name);
  if (found != known.end()) return static_cast<std::uint32_t>(found - known.begin());
  refuse_actuator("'" + std::string(name) + "'" + names_instead(name, known));
}

std::uint32_t CommandCheck::actuator(std::int64_t index) const {
  const auto count = static_cast<std::int64_t>(schema_.actuators.size());
  if (index >= 0 && index < count) return static_cast<std::uint32_t>(index);
  std::vector<std::string> known = names_of(schema_.actuators);
  for (std::size_t i = 0; i < known.size(); ++i) known[i] += " (" + std::to_string(i) + ")";
  refuse_actuator(std::to_string(index) + names_instead("", known));
}

void CommandCheck::refuse_actuator(const std::string& which) const {
  const std::string robot = "'" + schema_.head.robot.str() + "' has no actuator";
  throw InvalidArgument(schema_.actuators.empty() ? robot + "s" : robot + " " + which);
}

void CommandCheck::targets(std::uint32_t index, std::span<const std::byte> states,
                           std::span<const std::uint64_t> mask) const {
  const std::uint32_t known = actuator(std::int64_t{index});
  const StateLayout& layout = targets_.layout(known);
  if (states.empty() || states.size() % layout.size() != 0) {
    throw InvalidArgument("targets of " + of_actuator(schema_, known) + " must be a multiple of " +
                          std::to_string(layout.size()) + " bytes, got " +
                          std::to_string(states.size()));
  }
  if (!mask.empty() && mask.size() != layout.mask_words()) {
    throw InvalidArgument("a mask for " + of_actuator(schema_, known) + " must have " +
                          std::to_string(layout.mask_words()) + " words, got " +
                          std::to_string(mask.size()));
  }
  for (const std::byte* state = states.data(); state != states.data() + states.size();
       state += layout.size()) {
    if (!targets_.admit(known, state, bits_of(mask))) refuse(known, state, bits_of(mask));
  }
}

void CommandCheck::refuse(std::uint32_t actuator, const std::byte* state,
                          const std::uint64_t* mask) const {
  const ActuatorRow& row = schema_.actuators[actuator];
  const StateLayout& layout = targets_.layout(actuator);
  for (std::uint32_t i = 0; i < row.limits; ++i) {
    if (!masked(mask, i)) continue;
    const NumberName name = name_at(schema_, row.type, layout.numbers()[i].offset);
    const std::string number = of_number(schema_, actuator, name);
    if (!layout.proper_number(i, state)) {
      throw InvalidArgument("the target of " + number +
                            " must be one of: " + labels_of(schema_, *name.field));
    }
    if (!layout.numbers()[i].moves()) continue;
    const double value = layout.number(i, state);
    const LimitRow& limit = schema_.limits[row.first_limit + i];
    if (!std::isfinite(value)) {
      throw InvalidArgument("target " + text_of(value) + " for " + number +
                            " is not a finite number");
    }
    if (value < limit.minimum || value > limit.maximum) {
      throw InvalidArgument("target " + with_unit(text_of(value), name.field) + " for " + number +
                            " is outside its limits: from " + text_of(limit.minimum) + " to " +
                            with_unit(text_of(limit.maximum), name.field));
    }
  }
  throw InvalidArgument("the target of " + of_actuator(schema_, actuator) + " is invalid");
}

void CommandCheck::direct(std::uint32_t actuator, std::span<const std::byte> state,
                          std::span<const std::uint64_t> mask) const {
  if (schema_.head.bursting != 0 || schema_.head.silence > 0) return;
  const ActuatorRow& row = schema_.actuators[actuator];
  const StateLayout& layout = targets_.layout(actuator);
  for (std::uint32_t i = 0; i < row.limits; ++i) {
    const LimitRow& limit = schema_.limits[row.first_limit + i];
    const double value = layout.number(i, state.data());
    if (limit.resting == 0 || !masked(bits_of(mask), i) || value == limit.rest) continue;
    ShortText<200> name;
    name_number(schema_, actuator, i, name);
    throw InvalidArgument(
        "a direct target of " + text_of(value) + " for the " + std::string(name.view()) +
        " would stay if this program hung: start the backend with a watchdog (--silence N, with "
        "--stale purge, halt or stop), or give the command a duration, a speed or iterations");
  }
}

void CommandCheck::speed(std::uint32_t index, double speed,
                         std::span<const std::uint64_t> mask) const {
  const std::uint32_t known = actuator(std::int64_t{index});
  const ActuatorRow& row = schema_.actuators[known];
  const StateLayout& layout = targets_.layout(known);
  if (row.limits == 0) return;
  const std::uint32_t first = layout.first_commanded(bits_of(mask));
  const std::uint32_t number = first == StateLayout::kNoNumber ? 0 : first;
  const double highest = schema_.limits[row.first_limit + number].speed;
  const bool positive = std::isfinite(speed) && speed > 0.0;
  if (positive && !(speed > highest)) return;

  const NumberName name = name_at(schema_, row.type, layout.numbers()[number].offset);
  const std::string of_field = name.field != nullptr ? name.field->unit.str() : "";
  const std::string unit = " [" + (of_field.empty() ? "1" : of_field) + "/s]";
  const std::string what =
      "speed " + text_of(speed) + unit + " for " + of_number(schema_, known, name);
  if (!positive) throw InvalidArgument(what + " must be positive and finite");
  throw InvalidArgument(what + " is above its maximum: " + text_of(highest) + unit);
}

void CommandCheck::fastest(std::uint32_t index, std::span<const std::uint64_t> mask) const {
  const std::uint32_t known = actuator(std::int64_t{index});
  const std::uint32_t number = targets_.first_without_acceleration(known, bits_of(mask));
  if (number == StateLayout::kNoNumber) return;
  const std::uint32_t offset = targets_.layout(known).numbers()[number].offset;
  const NumberName name = name_at(schema_, schema_.actuators[known].type, offset);
  throw InvalidArgument("the fastest motion of " + of_number(schema_, known, name) +
                        " is unknown: its driver sets no limits of speed and acceleration. Give "
                        "a duration or a speed instead, or leave that field out.");
}

void CommandCheck::request(std::uint32_t index, std::span<const std::byte> payload) const {
  if (index >= schema_.requests.size()) {
    throw InvalidArgument("'" + schema_.head.robot.str() + "' has no request " +
                          std::to_string(index) + names_instead("", names_of(schema_.requests)));
  }
  const RequestRow& row = schema_.requests[index];
  const std::size_t size = row.type == kNoType ? 0 : layouts_[row.type]->size();
  if (payload.size() != size) {
    throw InvalidArgument("request '" + row.name.str() + "' must have " + std::to_string(size) +
                          " bytes, got " + std::to_string(payload.size()));
  }
  if (size == 0) return;
  const StateLayout& layout = *layouts_[row.type];
  for (std::size_t i = 0; i < layout.numbers().size(); ++i) {
    if (layout.proper_number(i, payload.data())) continue;
    const NumberName name = name_at(schema_, row.type, layout.numbers()[i].offset);
    throw InvalidArgument("'" + name.path + "' of request '" + row.name.str() +
                          "' must be one of: " + labels_of(schema_, *name.field));
  }
}

}  // namespace o80
