#include "describe/table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <type_traits>

#include "base/printable.hpp"
#include "describe/visit_number.hpp"

namespace o80 {

namespace {

constexpr std::uint32_t kMaxRows = 1U << 20;
constexpr std::uint32_t kMaxActuators =
    0xFFFF;  // a record has 16 bits for an actuator; one value means all
constexpr std::uint32_t kLargestType = 1U << 28;
constexpr std::uint32_t kLargestOfFace = 1U << 24;  // a face may come from a stranger
constexpr std::uint32_t kMaxNested = 16;

[[noreturn]] void refuse(const std::string& why) {
  throw InvalidArgument("invalid description: " + why);
}

template <class Row>
void check_text(const Row& text, const char* what) {
  for (const char c : text.view()) {
    if (static_cast<unsigned char>(c) < 32 || c == 127) {
      refuse(std::string(what) + " contains a control character");
    }
  }
  if (text.chars.back() != 0) refuse(std::string(what) + " is not terminated");
  if (!is_utf8(text.view())) refuse(std::string(what) + " is not valid UTF-8");
}

void check_field(const Schema& schema, std::uint32_t type_index, const FieldRow& field) {
  const TypeRow& type = schema.types[type_index];
  const std::string name = "field '" + field.name.str() + "' of '" + type.name.str() + "' ";
  check_text(field.name, "a field's name");
  check_text(field.unit, "a unit");
  check_text(field.help, "a help");
  const std::uint64_t elements =
      std::uint64_t{field.rows == 0 ? 1 : field.rows} * (field.columns == 0 ? 1 : field.columns);
  if (elements > kLargestType) refuse(name + "has too many elements");
  if (field.offset + field.size * elements > type.size) refuse(name + "lies outside its struct");
  if (field.rows == 0 && field.columns != 0) refuse(name + "has columns without rows");
  const bool moves = field.kind != Kind::structure && field.kind != Kind::boolean &&
                     field.kind != Kind::enumeration;
  if (field.resting > 1 || !std::isfinite(field.rest) || (field.resting == 1 && !moves)) {
    refuse(name + "cannot rest: rests_at() needs a numeric field and a finite value");
  }
  if (field.origin > Origin::absent) refuse(name + "has an unknown origin");
  switch (field.kind) {
    case Kind::structure:
      // a nested type comes before the type that contains it, so there is no cycle
      if (field.type >= type_index) refuse(name + "nests a type that comes after its own");
      if (field.size != schema.types[field.type].size)
        refuse(name + "differs in size from its type");
      break;
    case Kind::enumeration:
      if (field.size != 1 && field.size != 2 && field.size != 4 && field.size != 8) {
        refuse(name + "is an enumeration of " + std::to_string(field.size) +
               " bytes, not 1, 2, 4 or 8");
      }
      if (std::uint64_t{field.first_label} + field.labels > schema.labels.size()) {
        refuse(name + "refers to missing labels");
      }
      break;
    default:
      if (static_cast<int>(field.kind) > static_cast<int>(Kind::float64)) {
        refuse(name + "has a kind that a segment cannot hold");
      }
      if (field.size != size_of(field.kind)) refuse(name + "differs in size from its kind");
  }
}

/// Checks all types; returns the count of numbers of each type and its nested types.
std::vector<std::uint64_t> check_types(const Schema& schema) {
  std::vector<std::uint64_t> numbers;
  std::vector<std::uint32_t> depths;
  for (std::uint32_t i = 0; i < schema.types.size(); ++i) {
    const TypeRow& type = schema.types[i];
    check_text(type.name, "a type's name");
    const std::string name = "type '" + type.name.str() + "' ";
    if (type.size > kLargestType) refuse(name + "is too large");
    if (type.alignment == 0 || type.alignment > 64 ||
        (type.alignment & (type.alignment - 1)) != 0) {
      refuse(name + "has the invalid alignment " + std::to_string(type.alignment));
    }
    if (std::uint64_t{type.first_field} + type.fields > schema.fields.size()) {
      refuse(name + "refers to missing fields");
    }
    const bool has_value = type.first_default != kNoType;
    if (has_value && std::uint64_t{type.first_default} + type.size > schema.defaults.size()) {
      refuse(name + "refers to missing default values");
    }
    std::set<std::string_view> names;
    std::uint64_t count = 0;
    std::uint32_t depth = 0;
    for (std::uint32_t f = 0; f < type.fields; ++f) {
      const FieldRow& field = schema.fields[type.first_field + f];
      check_field(schema, i, field);
      if (field.has_default > (has_value ? 1 : 0)) {
        refuse(name + "lacks the default value of '" + field.name.str() + "'");
      }
      if (!names.insert(field.name.view()).second) {
        refuse(name + "has two fields '" + field.name.str() + "'");
      }
      const bool nested = field.kind == Kind::structure;
      count += std::uint64_t{field.count()} * (nested ? numbers[field.type] : 1);
      if (count > kLargestType) refuse(name + "has too many numbers");
      if (nested) depth = std::max(depth, depths[field.type] + 1);
    }
    if (depth > kMaxNested) refuse(name + "is nested too deeply");
    numbers.push_back(count);
    depths.push_back(depth);
  }
  return numbers;
}

/// True if a field of this kind can hold the rest value.
bool can_rest(const FieldRow& field, double rest) {
  if (field.kind == Kind::boolean || field.kind == Kind::enumeration) return false;
  return visit_number(field.kind, [rest]<class T>(T) {
    using Range = std::numeric_limits<T>;
    const bool whole = !std::is_integral_v<T> || std::trunc(rest) == rest;
    return whole && rest >= static_cast<double>(Range::lowest()) &&
           rest <= static_cast<double>(Range::max());
  });
}

void check_limit(const ActuatorRow& actuator, const FieldRow& field, const LimitRow& limit) {
  if (limit.resting == 1 && !can_rest(field, limit.rest)) {
    const std::string name = field.name.view().empty() ? "" : "'" + field.name.str() + "' of ";
    refuse(name + "actuator '" + actuator.name.str() + "' cannot rest at " +
           std::to_string(limit.rest) +
           ": rests_at() needs a numeric field and a value that the "
           "field can hold");
  }
  const std::string of = "limits of actuator '" + actuator.name.str() + "': ";
  if (std::isnan(limit.minimum) || std::isnan(limit.maximum) || limit.minimum > limit.maximum) {
    refuse(of + "the minimum must not exceed the maximum, got " + std::to_string(limit.minimum) +
           " to " + std::to_string(limit.maximum));
  }
  const auto positive = [&](double value, const char* what) {
    if (!(value > 0)) {
      refuse(of + what + " must be positive, got " + std::to_string(value));
    }
  };
  if (limit.resting > 1 || !std::isfinite(limit.rest) ||
      (limit.resting == 1 && (limit.rest < limit.minimum || limit.rest > limit.maximum))) {
    refuse(of + "the rest value must be from " + std::to_string(limit.minimum) + " to " +
           std::to_string(limit.maximum) + ", got " + std::to_string(limit.rest));
  }
  positive(limit.speed, "speed");
  positive(limit.acceleration, "acceleration");
  positive(limit.jerk, "jerk");
  positive(limit.error, "error");
  if (!(limit.noise >= 0.0F) || !std::isfinite(limit.noise)) {
    refuse(of + "noise must be a finite number of 0 or more, got " + std::to_string(limit.noise));
  }
  if (std::isfinite(limit.jerk) && !std::isfinite(limit.acceleration)) {
    refuse(of + "jerk without an acceleration; set both");
  }
  if (std::isfinite(limit.acceleration) && !std::isfinite(limit.speed)) {
    refuse(of + "acceleration without a speed; set both");
  }
}

void check_actuators(const Schema& schema, const std::vector<std::uint64_t>& numbers) {
  if (schema.actuators.size() >= kMaxActuators) refuse("too many actuators");
  std::set<std::string_view> names;
  std::size_t limits = 0;
  for (const ActuatorRow& actuator : schema.actuators) {
    const std::string name = "actuator '" + actuator.name.str() + "' ";
    check_text(actuator.name, "an actuator's name");
    if (actuator.name.view().empty()) refuse("an actuator has no name");
    if (!names.insert(actuator.name.view()).second)
      refuse("two actuators are called '" + actuator.name.str() + "'");
    if (actuator.type >= schema.types.size()) refuse(name + "refers to a missing type");
    const TypeRow& type = schema.types[actuator.type];
    if (std::uint64_t{actuator.offset} + type.size > schema.head.block) {
      refuse(name + "lies outside the row");
    }
    if (type.alignment > 1 && actuator.offset % type.alignment != 0) {
      refuse(name + "is not aligned");
    }
    if (actuator.group >= schema.groups.size()) refuse(name + "refers to a missing group");
    if (static_cast<int>(actuator.when_idle) > static_cast<int>(WhenIdle::follow)) {
      refuse(name + "has an unknown when_idle");
    }
    if (actuator.first_limit != limits || actuator.limits != numbers[actuator.type] ||
        actuator.limits > schema.limits.size() - limits) {
      refuse(name + "must have one limit for each number of its state");
    }
    limits += actuator.limits;
    const LimitRow* limit = schema.limits.data() + actuator.first_limit;
    schema.each_scalar(actuator.type, [&](std::uint32_t, const FieldRow& field) {
      check_limit(actuator, field, *limit++);
    });
  }
  if (limits != schema.limits.size()) refuse("a limit belongs to no actuator");
}

void check_integral(const Schema& schema, const ActuatorRow& actuator, const IntegralRow& row) {
  const std::string of = "the integral bounds of actuator '" + actuator.name.str() + "': ";
  const std::uint32_t own = row.limit - actuator.first_limit;
  if (row.number >= actuator.limits || row.number == own) {
    refuse(of + "they must name another field of its state");
  }
  std::uint32_t i = 0;
  schema.each_scalar(actuator.type, [&](std::uint32_t, const FieldRow& field) {
    const bool is_used = i == own || i == row.number;
    ++i;
    if (!is_used || field.kind == Kind::float64 || field.kind == Kind::float32) return;
    refuse(of + "'" + field.name.str() + "' is not a floating-point number");
  });
  if (std::isnan(row.minimum) || std::isnan(row.maximum) || row.minimum > row.maximum) {
    refuse(of + "the minimum must not exceed the maximum, got " + std::to_string(row.minimum) +
           " to " + std::to_string(row.maximum));
  }
  if (!std::isfinite(row.reaction) || row.reaction < 0.0) {
    refuse(of + "the reaction must be a time of 0 s or more, got " + std::to_string(row.reaction));
  }
  const LimitRow& limit = schema.limits[row.limit];
  if (std::isfinite(limit.jerk)) {
    refuse(of +
           "a number with an integral must have no limit of jerk: its speed and acceleration "
           "are the acceleration and the jerk of the integral");
  }
  if (limit.minimum > 0.0 || limit.maximum < 0.0 || limit.resting == 0 || limit.rest != 0.0) {
    refuse(of +
           "a number with an integral must rest at 0; describe rests_at(0), and limits around 0");
  }
}

void check_integrals(const Schema& schema) {
  std::set<std::uint32_t> used;
  for (const IntegralRow& row : schema.integrals) {
    const auto owner = std::ranges::find_if(schema.actuators, [&](const ActuatorRow& actuator) {
      return row.limit >= actuator.first_limit &&
             row.limit - actuator.first_limit < actuator.limits;
    });
    if (owner == schema.actuators.end() || !used.insert(row.limit).second) {
      refuse("integral bounds of a missing number, or two of one number");
    }
    check_integral(schema, *owner, row);
  }
}

void check_groups(const Schema& schema) {
  std::uint64_t next = 0;
  for (const GroupRow& group : schema.groups) {
    check_text(group.name, "a group's name");
    if (group.type >= schema.types.size()) {
      refuse("group '" + group.name.str() + "' refers to a missing type");
    }
    if (group.first_actuator != next || next + group.count > schema.actuators.size()) {
      refuse("group '" + group.name.str() + "' refers to missing actuators");
    }
    if (group.is_array == 0 && group.count != 1)
      refuse("a group without an array must have one actuator");
    next += group.count;
    for (std::uint32_t i = 0; i < group.count; ++i) {
      const ActuatorRow& actuator = schema.actuators[group.first_actuator + i];
      if (actuator.type != group.type ||
          actuator.offset != group.offset + std::uint64_t{i} * schema.types[group.type].size) {
        refuse("the actuators of group '" + group.name.str() + "' do not form an array");
      }
    }
  }
  if (next != schema.actuators.size()) refuse("an actuator belongs to no group");
}

void check_shown(const Schema& schema) {
  const ShownModel& shown = schema.shown;
  if (shown.mjcf.size() > ShownModel::kLargest || shown.file.size() > ShownModel::kLargest ||
      shown.values.size() > kMaxRows) {
    refuse("the model that shows the robot is too large");
  }
  if (!is_utf8(shown.mjcf) || !is_utf8(shown.file)) refuse("the model is not valid UTF-8");
  const std::uint64_t extended =
      schema.head.extended == kNoType ? 0 : schema.types[schema.head.extended].size;
  for (const ShownRow& row : shown.values) {
    check_text(row.name, "the name of a joint or a body");
    if (row.what > Shown::position || row.from > ShownFrom::extended) {
      refuse("a value of the model is of an unknown kind");
    }
    const std::uint64_t size = sizeof(double) * (row.what == Shown::joint ? 1 : 3);
    const std::uint64_t block = row.from == ShownFrom::states ? schema.head.block : extended;
    if (row.offset + size > block) {
      refuse("the value of '" + row.name.str() + "' in the model lies outside the row");
    }
  }
}

}  // namespace

void check(const Schema& schema) {
  check_text(schema.head.robot, "the robot's name");
  if (schema.head.period < 0) refuse("the period is negative");
  if (schema.head.block > kLargestType) refuse("the row is too large");
  if (static_cast<int>(schema.head.clock) > static_cast<int>(Clock::simulated)) {
    refuse("the clock is unknown");
  }
  if (schema.head.stale > Stale::halt || schema.head.silence < 0) {
    refuse("the watchdog settings are invalid");
  }
  const std::vector<std::uint64_t> numbers = check_types(schema);
  if (schema.head.extended != kNoType && schema.head.extended >= schema.types.size()) {
    refuse("the extended type is missing");
  }
  for (const LabelRow& label : schema.labels) check_text(label.name, "a label");
  check_actuators(schema, numbers);
  check_integrals(schema);
  check_groups(schema);
  check_shown(schema);
  if (schema.requests.size() >= kMaxActuators) refuse("too many requests");
  std::set<std::string_view> names;
  for (const RequestRow& request : schema.requests) {
    check_text(request.name, "a request's name");
    check_text(request.help, "a help");
    if (request.type >= schema.types.size()) {
      refuse("request '" + request.name.str() + "' refers to a missing type");
    }
    if (!names.insert(request.name.view()).second) {
      refuse("two requests are called '" + request.name.str() + "'");
    }
  }
}

void check_face(const Schema& face) {
  const std::int64_t period = face.head.period;
  if (period != 0 && (period < 1'000 || period > 1'000'000'000'000)) {
    throw InvalidArgument("the period of the face must be from 1000 to 1e12 ns, or 0, got " +
                          std::to_string(period));
  }
  check(face);
  for (const TypeRow& type : face.types) {
    if (type.size > kLargestOfFace) {
      throw InvalidArgument("the type '" + type.name.str() + "' of the face is too large");
    }
    if (type.blends == 0) continue;
    throw InvalidArgument("the state '" + type.name.str() +
                          "' has an interpolation that only its robot knows");
  }
}

Schema schema_from_bytes(std::span<const std::byte> bytes) {
  try {
    Schema schema = describing::schema_in(bytes);
    check(schema);
    return schema;
  } catch (const InvalidArgument& error) {
    throw SegmentError("the segment's schema cannot be read (" + std::string(error.what()) +
                       "): the file is damaged or comes from another version of o80; remove it "
                       "with `o80 clean` or start its backend again");
  }
}

std::uint64_t hash(const Schema& schema) { return describing::hash_of(to_bytes(schema)); }

}  // namespace o80
