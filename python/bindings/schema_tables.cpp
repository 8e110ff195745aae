#include "schema_tables.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

#include "base/printable.hpp"
#include "o80/describe/layout.hpp"

namespace o80 {
namespace {

nb::str text(std::string_view words) {
  const std::string clean = printable(words);  // another process has written them
  return nb::str(clean.data(), clean.size());
}

nb::object number(double value) { return std::isfinite(value) ? nb::cast(value) : nb::none(); }

/// With the fewest digits that read back as the same float32.
nb::object number(float value) {
  std::array<char, 24> digits{};
  const auto end = std::to_chars(digits.begin(), digits.end(), value).ptr;
  double nearest = value;
  std::from_chars(digits.begin(), end, nearest);
  return number(nearest);
}

template <class Rows, class Convert>
nb::list list_of(const Rows& rows, Convert&& convert) {
  nb::list list;
  for (const auto& row : rows) list.append(convert(row));
  return list;
}

auto fields_of(const Schema& schema, const TypeRow& type) {
  return std::span(schema.fields).subspan(type.first_field, type.fields);
}

template <class T>
T number_at(const std::byte* from) {
  T number;
  std::memcpy(&number, from, sizeof number);
  return number;
}

/// An integer of 1 to 8 bytes.
nb::object integer_at(const std::byte* from, std::uint32_t size, bool is_signed) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, from, size);  // little-endian
  if (!is_signed) return nb::cast(bits);
  const std::uint32_t unused = 64 - 8 * size;
  return nb::cast(static_cast<std::int64_t>(bits << unused) >> unused);
}

nb::object value_at(const Schema& schema, const FieldRow& field, const std::byte* from);

nb::object element_at(const Schema& schema, const FieldRow& field, const std::byte* from) {
  switch (field.kind) {
    case Kind::structure: {
      nb::dict members;
      for (const FieldRow& member : fields_of(schema, schema.types[field.type])) {
        members[text(member.name.view())] = value_at(schema, member, from + member.offset);
      }
      return members;
    }
    case Kind::boolean:
      return nb::cast(number_at<std::uint8_t>(from) != 0);
    case Kind::float32:
      return number(double{number_at<float>(from)});
    case Kind::float64:
      return number(number_at<double>(from));
    case Kind::enumeration:
      return integer_at(from, field.size, field.is_signed != 0);
    default:
      return integer_at(from, field.size, field.kind < Kind::uint8);
  }
}

/// The value of a field; of an array field a list, or a list of lists.
nb::object value_at(const Schema& schema, const FieldRow& field, const std::byte* from) {
  if (field.rows == 0) return element_at(schema, field, from);
  const auto next = [&] {
    return element_at(schema, field, std::exchange(from, from + field.size));
  };
  nb::list rows;
  for (std::uint32_t i = 0; i < field.rows; ++i) {
    if (field.columns == 0) {
      rows.append(next());
      continue;
    }
    nb::list columns;
    for (std::uint32_t j = 0; j < field.columns; ++j) columns.append(next());
    rows.append(columns);
  }
  return rows;
}

nb::dict of_type(const Schema& schema, std::uint32_t index);

nb::dict of_field(const Schema& schema, const TypeRow& type, const FieldRow& field) {
  nb::dict found;
  found["name"] = text(field.name.view());
  found["kind"] = kKindNames[static_cast<int>(field.kind)];
  found["offset"] = field.offset;
  found["size"] = field.size;
  nb::list shape;
  if (field.rows != 0) shape.append(field.rows);
  if (field.columns != 0) shape.append(field.columns);
  found["shape"] = shape;
  found["unit"] = text(field.unit.view());
  found["help"] = text(field.help.view());
  if (field.resting != 0) found["rest"] = number(field.rest);
  if (field.origin != Origin::robot) {
    found["origin"] = kOriginNames[static_cast<int>(field.origin)];
  }
  if (field.has_default != 0) {
    found["default"] =
        value_at(schema, field, schema.defaults.data() + type.first_default + field.offset);
  }
  if (field.kind == Kind::enumeration) {
    found["signed"] = field.is_signed != 0;
    nb::dict labels;
    for (std::uint32_t i = 0; i < field.labels; ++i) {
      const LabelRow& label = schema.labels[field.first_label + i];
      labels[text(label.name.view())] = label.value;
    }
    found["labels"] = labels;
  }
  if (field.kind == Kind::structure) found["type"] = of_type(schema, field.type);
  return found;
}

nb::dict of_type(const Schema& schema, std::uint32_t index) {
  const TypeRow& type = schema.types[index];
  nb::dict found;
  found["name"] = text(type.name.view());
  found["size"] = type.size;
  if (type.blends != 0) found["blends"] = true;
  found["fields"] = list_of(fields_of(schema, type),
                            [&](const FieldRow& field) { return of_field(schema, type, field); });
  return found;
}

nb::dict of_limit(const Schema& schema, std::uint32_t index) {
  const LimitRow& limit = schema.limits[index];
  nb::dict found;
  found["minimum"] = number(limit.minimum);
  found["maximum"] = number(limit.maximum);
  found["speed"] = number(limit.speed);
  found["acceleration"] = number(limit.acceleration);
  found["jerk"] = number(limit.jerk);
  found["error"] = number(limit.error);
  if (limit.noise != 0.0F) found["noise"] = number(limit.noise);
  if (limit.resting != 0) found["rest"] = number(limit.rest);
  for (const IntegralRow& row : schema.integrals) {
    if (row.limit != index) continue;
    nb::dict integral;
    integral["number"] = row.number;
    integral["minimum"] = number(row.minimum);
    integral["maximum"] = number(row.maximum);
    integral["reaction"] = number(row.reaction);
    found["integral"] = integral;
  }
  return found;
}

nb::dict of_actuator(const Schema& schema, const ActuatorRow& actuator) {
  nb::dict found;
  found["name"] = text(actuator.name.view());
  found["offset"] = actuator.offset;
  found["when_idle"] = actuator.when_idle == WhenIdle::hold ? "hold" : "follow";
  found["group"] = actuator.group;
  nb::list limits;
  for (std::uint32_t i = 0; i < actuator.limits; ++i) {
    limits.append(of_limit(schema, actuator.first_limit + i));
  }
  found["limits"] = limits;
  return found;
}

/// Offsets in a row.
nb::dict of_row(const RowLayout& layout) {
  nb::dict found;
  const std::pair<const char*, std::uint32_t> parts[] = {{"size", layout.size},
                                                         {"iteration", 0},
                                                         {"time", 8},
                                                         {"lateness", 16},
                                                         {"overruns", 24},
                                                         {"skipped", 28},
                                                         {"fresh", 32},
                                                         {"halted", 36},
                                                         {"starvations", 40},
                                                         {"desired", layout.desired},
                                                         {"observed", layout.observed},
                                                         {"extended", layout.extended},
                                                         {"active", layout.active},
                                                         {"clamped", layout.clamped},
                                                         {"braking", layout.braking},
                                                         {"starved", layout.starved},
                                                         {"off_plan", layout.off_plan},
                                                         {"mask_words", layout.mask_words},
                                                         {"extended_size", layout.extended_size}};
  for (const auto& [name, value] : parts) found[name] = value;
  return found;
}

/// Without the text of the model, which is long.
nb::dict of_model(const ShownModel& shown) {
  nb::dict found;
  found["file"] = text(shown.file);
  found["bytes"] = shown.mjcf.size();
  found["values"] = list_of(shown.values, [](const ShownRow& row) {
    nb::dict value;
    value["name"] = text(row.name.view());
    value["what"] = row.what == Shown::joint ? "joint" : "position";
    value["from"] = row.from == ShownFrom::states ? "states" : "extended";
    value["offset"] = row.offset;
    return value;
  });
  return found;
}

}  // namespace

nb::dict tables_of(const Schema& schema) {
  nb::dict found;
  found["robot"] = text(schema.head.robot.view());
  found["period"] = schema.head.period;
  found["clock"] = schema.head.clock == Clock::simulated ? "simulated" : "monotonic";
  found["bursting"] = schema.head.bursting != 0;
  found["silence"] = schema.head.silence;
  found["stale"] = text(name_of(schema.head.stale));
  found["of_the_world"] = schema.head.of_the_world % 2 == 1;
  found["simulated"] = schema.head.is_simulated();
  if (schema.head.gap != 0) found["gap"] = schema.head.gap * 1e-6;
  found["row"] = of_row(row_layout(schema));
  found["groups"] = list_of(schema.groups, [&](const GroupRow& group) {
    nb::dict of_group;
    of_group["name"] = text(group.name.view());
    of_group["array"] = group.is_array != 0;
    of_group["offset"] = group.offset;
    of_group["first_actuator"] = group.first_actuator;
    of_group["count"] = group.count;
    of_group["type"] = of_type(schema, group.type);
    return of_group;
  });
  found["actuators"] = list_of(
      schema.actuators, [&](const ActuatorRow& actuator) { return of_actuator(schema, actuator); });
  if (schema.head.extended != kNoType) found["extended"] = of_type(schema, schema.head.extended);
  found["requests"] = list_of(schema.requests, [&](const RequestRow& request) {
    nb::dict of_request;
    of_request["name"] = text(request.name.view());
    of_request["help"] = text(request.help.view());
    of_request["type"] = of_type(schema, request.type);
    of_request["while_halted"] = request.while_halted != 0;
    return of_request;
  });
  if (!schema.shown.empty()) found["model"] = of_model(schema.shown);
  return found;
}

}  // namespace o80
