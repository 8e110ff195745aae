#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "o80/base/nearest_name.hpp"
#include "o80/describe/hooks.hpp"
#include "o80/describe/rows.hpp"
#include "o80/describe/shown_model.hpp"

namespace o80 {

/// Bounds of the observed position that a velocity of the same actuator moves. o80 brakes in
/// time and, outside of the bounds, allows motion inwards only.
struct IntegralBounds {
  std::string_view field;  // of the observed state; of an array, the element of the same index
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  double reaction = 0.0;  // delay from desired to observed velocity [s]
};

/// Limits of one number of a state, set by a driver. Default: no limit.
struct Limits {
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  double speed = std::numeric_limits<double>::infinity();         // [1/s]
  double acceleration = std::numeric_limits<double>::infinity();  // [1/s^2], needs a speed
  double jerk = std::numeric_limits<double>::infinity();          // [1/s^3], needs an acceleration
  /// Largest allowed |desired - observed|; a larger one halts the backend.
  double error = std::numeric_limits<double>::infinity();
  /// Largest difference of two readings, in addition to the motion at `speed`; a larger one marks
  /// the reading as wrong. 0: a tenth of `error`.
  double noise = 0.0;
  /// Field of which the number is the velocity, if any; then without a jerk limit.
  IntegralBounds integral = {};

  LimitRow row(double rest = 0.0, bool resting = false) const {
    return {minimum,
            maximum,
            speed,
            acceleration,
            jerk,
            error,
            rest,
            resting ? 1U : 0U,
            static_cast<float>(noise)};
  }
};

/// Makes a field go to `value` without a command (for example a velocity to 0).
struct RestsAt {
  double value;
};
constexpr RestsAt rests_at(double value) { return {value}; }

class Schema;

/// Describes one actuator of a driver: `schema.actuator("elbow").limits({.maximum = 1.0})`.
class ActuatorDescription {
 public:
  ActuatorDescription(Schema& schema, std::uint32_t index) : schema_(schema), index_(index) {}

  ActuatorDescription& name(std::string_view name);
  ActuatorDescription& when_idle(WhenIdle when_idle);
  /// Limits of the first number of the state.
  ActuatorDescription& limits(const Limits& limits);
  /// Limits of a named field of the state (of every element of an array field).
  ActuatorDescription& limits(std::string_view field, const Limits& limits);
  /// The rest value of a named field of this actuator (of every element of an array field).
  ActuatorDescription& rests_at(std::string_view field, double value);
  /// Unit of a state that is a plain number, for example "rad". It holds for all actuators of the
  /// group; the fields of a described struct have theirs from O80_DESCRIBE.
  ActuatorDescription& unit(std::string_view unit);
  /// Declares the first number of the state, a double, the position of a joint of `Schema::shown`.
  ActuatorDescription& moves_joint(std::string_view joint);

 private:
  /// The numbers of a named field, or the first one if `field` is empty.
  struct Numbers {
    std::uint32_t first;  // index in the state
    std::uint32_t count;
  };
  Numbers numbers_of(std::string_view field) const;

  Schema& schema_;
  std::uint32_t index_;
};

/// Description of a robot as tables of fixed-size entries, stored in a segment as bytes.
///
/// Header-only, so that a robot library need not link o80.
class Schema {
 public:
  SchemaHead head;
  std::vector<TypeRow> types;
  std::vector<FieldRow> fields;
  std::vector<LabelRow> labels;
  std::vector<GroupRow> groups;
  std::vector<ActuatorRow> actuators;
  std::vector<LimitRow> limits;
  std::vector<IntegralRow> integrals;
  std::vector<RequestRow> requests;
  std::vector<std::byte> defaults;  // default values of types
  ShownModel shown;                 // for viewers
  std::vector<TypeHooks> hooks;     // one for each type; not in the segment
  std::vector<const void*> keys;    // one for each type: identifies its C++ type, or null

  // for the describe() of a driver
  /// The period requested by the user [ns]; 0: none.
  std::int64_t asked_period() const { return head.period; }
  /// Sets the period of this robot [ns]. Without this call the user chooses it.
  void period(std::int64_t own) { head.period = own; }
  /// Declares the robot a simulation. Every other robot counts as hardware: in real time a gap
  /// between two rows halts the robot, a reset cannot move it farther than its limits allow, and a
  /// replay does not start its driver.
  void simulated() { head.of_the_world = 2; }
  /// Deleted: a robot is of the world unless describe() calls simulated().
  template <int Unused = 0>
  void of_the_world() const {
    static_assert(Unused != 0,
                  "every robot is of the world unless describe() calls schema.simulated(): remove "
                  "this call (single fields are marked in O80_DESCRIBE: o80::of_the_world())");
  }
  /// Sets the longest time between two rows without a halt [ns], up to an hour, if that is less
  /// than the default.
  void gap(std::int64_t longest) {
    constexpr std::int64_t kHour = 3'600'000'000'000;
    if (longest < 1000 || longest > kHour) {
      throw InvalidArgument("the gap must be from 1000 to 3600000000000 ns, got " +
                            std::to_string(longest));
    }
    head.gap = static_cast<std::uint32_t>(longest / 1000);
  }
  ActuatorDescription actuator(std::uint32_t index);
  ActuatorDescription actuator(std::string_view name);

  // for layouts known at run time only; describe.hpp describes C++ types
  /// Adds a type from its fields, computes offsets and sizes, and returns its index.
  std::uint32_t add_type(std::string_view name, std::vector<FieldRow> members);
  /// Appends an array of actuators, or a single one; returns the index of the new group.
  std::uint32_t add_actuators(std::string_view group, std::uint32_t type, std::uint32_t count,
                              bool is_array = true);
  /// Adds a sensor value to the extended type; returns its offset in the extended block [bytes].
  std::uint32_t add_sensor(FieldRow sensor);
  /// Declares element `index` of an extended field of doubles the position of a joint of `shown`.
  void sensor_moves_joint(std::string_view field, std::uint32_t index, std::string_view joint);
  /// `while_halted`: serve the request also during a halt; the request must move nothing.
  std::uint32_t add_request(std::string_view name, std::uint32_t type, std::string_view help,
                            bool while_halted = false);

  /// Calls `visit(offset, const FieldRow&)` for every number of a type and of its nested types.
  template <class Visit>
  void each_scalar(std::uint32_t type, Visit&& visit, std::uint32_t base = 0) const;
  std::uint32_t scalar_count(std::uint32_t type) const;

  bool operator==(const Schema& other) const {
    return head == other.head && types == other.types && fields == other.fields &&
           labels == other.labels && groups == other.groups && actuators == other.actuators &&
           limits == other.limits && integrals == other.integrals && requests == other.requests &&
           defaults == other.defaults && shown == other.shown;
  }

  /// Adds a group of actuators at a given offset; used by describe_actuators().
  void place_group(std::string_view group, std::uint32_t type, std::uint32_t offset,
                   std::uint32_t count, bool is_array);
};

/// Size in shared memory of a number of this kind [bytes]; 0 for the kinds behind float64.
constexpr std::uint32_t size_of(Kind kind) {
  constexpr std::uint32_t kSizes[] = {1, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8};  // in the order of Kind
  return kind <= Kind::float64 ? kSizes[static_cast<std::size_t>(kind)] : 0;
}

/// A plain field for `Schema::add_type`: `scalar_field("position", Kind::float64, "[rad]")`.
FieldRow scalar_field(std::string_view name, Kind kind, std::string_view text = "",
                      std::uint32_t rows = 0, std::uint32_t columns = 0);

/// Splits "stiffness [Nm/rad]" into help and unit.
void set_text(FieldRow& field, std::string_view text);

inline constexpr std::uint32_t round_up(std::uint32_t value, std::uint32_t step) {
  return (value + step - 1) / step * step;
}

// ---------------------------------------------------------------------------------------------

inline void set_text(FieldRow& field, std::string_view text) {
  const auto open = text.rfind('[');
  const auto close = text.rfind(']');
  if (open == std::string_view::npos || close == std::string_view::npos || close < open) {
    field.help = FieldHelpText(text);
    return;
  }
  field.unit = UnitText(text.substr(open + 1, close - open - 1));
  auto help = text.substr(0, open);
  while (!help.empty() && help.back() == ' ') help.remove_suffix(1);
  field.help = FieldHelpText(help);
}

inline FieldRow scalar_field(std::string_view name, Kind kind, std::string_view text,
                             std::uint32_t rows, std::uint32_t columns) {
  FieldRow field;
  field.name = NameText(name);
  field.kind = kind;
  field.size = size_of(kind);
  field.rows = rows;
  field.columns = columns;
  set_text(field, text);
  return field;
}

inline std::uint32_t Schema::add_type(std::string_view name, std::vector<FieldRow> members) {
  TypeRow type;
  type.name = NameText(name);
  type.first_field = static_cast<std::uint32_t>(fields.size());
  type.fields = static_cast<std::uint32_t>(members.size());
  std::uint32_t end = 0;
  for (FieldRow& field : members) {
    const bool nested = field.kind == Kind::structure;
    const std::uint32_t alignment = nested ? types.at(field.type).alignment : field.size;
    if (alignment == 0) {
      throw InvalidArgument("field '" + field.name.str() + "' of '" + std::string(name) +
                            "' has no size: give its kind (or, for an enumeration, its size)");
    }
    if (nested) field.size = types.at(field.type).size;
    field.has_default = 0;  // add_type() stores no default values
    field.offset = round_up(end, alignment);
    end = field.offset + field.size * field.count();
    type.alignment = alignment > type.alignment ? alignment : type.alignment;
    fields.push_back(field);
  }
  type.size = round_up(end, type.alignment);
  types.push_back(type);
  hooks.emplace_back();
  keys.push_back(nullptr);
  return static_cast<std::uint32_t>(types.size() - 1);
}

template <class Visit>
void Schema::each_scalar(std::uint32_t type, Visit&& visit, std::uint32_t base) const {
  const TypeRow& row = types.at(type);
  for (std::uint32_t i = 0; i < row.fields; ++i) {
    const FieldRow& field = fields.at(row.first_field + i);
    for (std::uint32_t element = 0; element < field.count(); ++element) {
      const std::uint32_t offset = base + field.offset + element * field.size;
      if (field.kind == Kind::structure) {
        each_scalar(field.type, visit, offset);
      } else {
        visit(offset, field);
      }
    }
  }
}

inline std::uint32_t Schema::scalar_count(std::uint32_t type) const {
  std::uint32_t count = 0;
  each_scalar(type, [&](std::uint32_t, const FieldRow&) { ++count; });
  return count;
}

inline void Schema::place_group(std::string_view group, std::uint32_t type, std::uint32_t offset,
                                std::uint32_t count, bool is_array) {
  GroupRow row;
  row.name = NameText(group);
  row.type = type;
  row.offset = offset;
  row.first_actuator = static_cast<std::uint32_t>(actuators.size());
  row.count = count;
  row.is_array = is_array ? 1 : 0;
  const std::uint32_t scalars = scalar_count(type);
  const std::uint32_t stride = types.at(type).size;
  for (std::uint32_t i = 0; i < count; ++i) {
    ActuatorRow actuator;
    const std::string prefix(group);
    actuator.name = NameText(
        is_array ? (prefix.empty() ? "actuator_" : prefix + "_") + std::to_string(i) : prefix);
    actuator.type = type;
    actuator.offset = offset + i * stride;
    actuator.group = static_cast<std::uint32_t>(groups.size());
    actuator.first_limit = static_cast<std::uint32_t>(limits.size());
    actuator.limits = scalars;
    actuators.push_back(actuator);
    each_scalar(type, [&](std::uint32_t, const FieldRow& field) {
      limits.push_back(Limits{}.row(field.rest, field.resting != 0));
    });
  }
  groups.push_back(row);
}

inline std::uint32_t Schema::add_actuators(std::string_view group, std::uint32_t type,
                                           std::uint32_t count, bool is_array) {
  const std::uint32_t offset = round_up(head.block, types.at(type).alignment);
  place_group(group, type, offset, count, is_array);
  head.block = offset + count * types.at(type).size;
  return static_cast<std::uint32_t>(groups.size() - 1);
}

inline std::uint32_t Schema::add_sensor(FieldRow sensor) {
  // the fields of a type must be consecutive, and nested types must precede it: rebuild the type
  // at the end
  std::vector<FieldRow> members;
  if (head.extended != kNoType) {
    const TypeRow old = types.at(head.extended);
    members.assign(fields.begin() + old.first_field, fields.begin() + old.first_field + old.fields);
    for (const FieldRow& member : members) {
      if (member.name == sensor.name) {
        throw InvalidArgument("there is already a sensor '" + sensor.name.str() + "'");
      }
    }
    if (head.extended + 1 == types.size() && old.first_field + old.fields == fields.size()) {
      fields.resize(old.first_field);
      types.pop_back();
      hooks.pop_back();
      keys.pop_back();
    }
  }
  members.push_back(sensor);
  head.extended = add_type("Extended", members);
  return fields.back().offset;
}

inline void Schema::sensor_moves_joint(std::string_view field, std::uint32_t index,
                                       std::string_view joint) {
  const TypeRow none;
  const TypeRow& type = head.extended == kNoType ? none : types.at(head.extended);
  std::vector<std::string> known;
  for (std::uint32_t i = 0; i < type.fields; ++i) {
    const FieldRow& sensor = fields.at(type.first_field + i);
    known.push_back(sensor.name.str());
    if (sensor.name.view() != field) continue;
    if (sensor.kind != Kind::float64 || index >= sensor.count()) {
      throw InvalidArgument("extended field '" + known.back() + "' has no double with index " +
                            std::to_string(index) + " for joint '" + std::string(joint) + "'");
    }
    shown.joint(joint, sensor.offset + index * sensor.size, ShownFrom::extended);
    return;
  }
  throw InvalidArgument("there is no extended field '" + std::string(field) + "'" +
                        names_instead(field, known));
}

inline std::uint32_t Schema::add_request(std::string_view name, std::uint32_t type,
                                         std::string_view help, bool while_halted) {
  RequestRow row;
  row.name = NameText(name);
  row.help = HelpText(help);
  row.type = type;
  row.while_halted = while_halted ? 1 : 0;
  requests.push_back(row);
  return static_cast<std::uint32_t>(requests.size() - 1);
}

inline ActuatorDescription Schema::actuator(std::uint32_t index) {
  if (index >= actuators.size()) {
    throw InvalidArgument("there is no actuator " + std::to_string(index) + ": '" +
                          head.robot.str() + "' has " + std::to_string(actuators.size()));
  }
  return {*this, index};
}

inline ActuatorDescription Schema::actuator(std::string_view name) {
  std::vector<std::string> known;
  for (std::uint32_t i = 0; i < actuators.size(); ++i) {
    if (actuators[i].name.view() == name) return {*this, i};
    known.push_back(actuators[i].name.str());
  }
  throw InvalidArgument("there is no actuator '" + std::string(name) + "'" +
                        names_instead(name, known));
}

inline ActuatorDescription& ActuatorDescription::name(std::string_view name) {
  schema_.actuators[index_].name = NameText(name);
  return *this;
}

inline ActuatorDescription& ActuatorDescription::when_idle(WhenIdle when_idle) {
  schema_.actuators[index_].when_idle = when_idle;
  return *this;
}

inline ActuatorDescription& ActuatorDescription::limits(const Limits& limits) {
  return this->limits("", limits);
}

inline ActuatorDescription& ActuatorDescription::moves_joint(std::string_view joint) {
  const ActuatorRow& row = schema_.actuators[index_];
  const TypeRow& type = schema_.types.at(row.type);
  if (type.fields == 0 || schema_.fields.at(type.first_field).kind != Kind::float64) {
    throw InvalidArgument("the state of actuator '" + row.name.str() +
                          "' does not begin with a double: it cannot move joint '" +
                          std::string(joint) + "'");
  }
  schema_.shown.joint(joint, row.offset + schema_.fields[type.first_field].offset);
  return *this;
}

inline ActuatorDescription::Numbers ActuatorDescription::numbers_of(std::string_view field) const {
  const ActuatorRow& row = schema_.actuators[index_];
  if (field.empty()) return {0, row.limits > 0 ? 1U : 0U};
  const TypeRow& type = schema_.types.at(row.type);
  std::uint32_t first = 0;
  std::vector<std::string> known;
  for (std::uint32_t i = 0; i < type.fields; ++i) {
    const FieldRow& member = schema_.fields.at(type.first_field + i);
    const std::uint32_t inside =
        member.kind == Kind::structure ? schema_.scalar_count(member.type) : 1;
    const std::uint32_t numbers = inside * member.count();
    if (member.name.view() == field) return {first, numbers};
    known.push_back(member.name.str());
    first += numbers;
  }
  throw InvalidArgument("'" + type.name.str() + "' has no field '" + std::string(field) + "'" +
                        names_instead(field, known));
}

inline ActuatorDescription& ActuatorDescription::limits(std::string_view field,
                                                        const Limits& limits) {
  const Numbers numbers = numbers_of(field);
  const std::uint32_t first = schema_.actuators[index_].first_limit + numbers.first;
  for (std::uint32_t i = 0; i < numbers.count; ++i) {
    LimitRow& row = schema_.limits[first + i];
    row = limits.row(row.rest, row.resting != 0);
  }
  std::erase_if(schema_.integrals, [&](const IntegralRow& row) {
    return row.limit >= first && row.limit < first + numbers.count;
  });
  const IntegralBounds& integral = limits.integral;
  if (integral.field.empty()) return *this;
  const Numbers moved = numbers_of(integral.field);
  if (moved.count != numbers.count) {
    throw InvalidArgument("the integral '" + std::string(integral.field) + "' has " +
                          std::to_string(moved.count) + " numbers, what moves it has " +
                          std::to_string(numbers.count));
  }
  for (std::uint32_t i = 0; i < numbers.count; ++i) {
    schema_.integrals.push_back(
        {first + i, moved.first + i, integral.minimum, integral.maximum, integral.reaction});
  }
  return *this;
}

inline ActuatorDescription& ActuatorDescription::rests_at(std::string_view field, double value) {
  const Numbers numbers = numbers_of(field);
  const std::uint32_t first = schema_.actuators[index_].first_limit + numbers.first;
  for (std::uint32_t i = 0; i < numbers.count; ++i) {
    schema_.limits[first + i].rest = value;
    schema_.limits[first + i].resting = 1;
  }
  return *this;
}

inline ActuatorDescription& ActuatorDescription::unit(std::string_view unit) {
  GroupRow& group = schema_.groups.at(schema_.actuators.at(index_).group);
  const TypeRow type = schema_.types.at(group.type);
  FieldRow field = schema_.fields.at(type.first_field);
  if (type.fields != 1 || !field.name.view().empty()) {
    throw InvalidArgument("the state of actuator '" + schema_.actuators[index_].name.str() +
                          "' is a struct: give the units of its fields in O80_DESCRIBE");
  }
  // a separate type for the group, because other groups of plain numbers keep their units
  field.unit = UnitText(unit);
  TypeRow own = type;
  own.first_field = static_cast<std::uint32_t>(schema_.fields.size());
  const std::uint32_t former = group.type;
  group.type = static_cast<std::uint32_t>(schema_.types.size());
  schema_.fields.push_back(field);
  schema_.types.push_back(own);
  schema_.hooks.push_back(schema_.hooks.at(former));
  schema_.keys.push_back(nullptr);
  for (std::uint32_t i = 0; i < group.count; ++i) {
    schema_.actuators[group.first_actuator + i].type = group.type;
  }
  return *this;
}

}  // namespace o80
