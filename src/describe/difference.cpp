#include <algorithm>
#include <map>
#include <sstream>

#include "o80/describe/table.hpp"

namespace o80 {

namespace {

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string shape(const FieldRow& field) {
  if (field.rows == 0) return "";
  std::string text = "[" + std::to_string(field.rows);
  if (field.columns != 0) text += ", " + std::to_string(field.columns);
  return text + "]";
}

std::string kind_name(const Schema& schema, const FieldRow& field);

/// "position: float64 at 0" for every field, by name.
std::map<std::string, std::string> fields_of(const Schema& schema, std::uint32_t type) {
  std::map<std::string, std::string> lines;
  if (type == kNoType) return lines;
  const TypeRow& row = schema.types[type];
  for (std::uint32_t i = 0; i < row.fields; ++i) {
    const FieldRow& field = schema.fields[row.first_field + i];
    const std::string unit = field.unit.view().empty() ? "" : " [" + field.unit.str() + "]";
    lines[field.name.str()] =
        kind_name(schema, field) + shape(field) + unit + " at byte " + std::to_string(field.offset);
  }
  return lines;
}

std::string kind_name(const Schema& schema, const FieldRow& field) {
  static constexpr const char* kNames[] = {"boolean", "int8",   "int16",  "int32",  "int64",
                                           "uint8",   "uint16", "uint32", "uint64", "float32",
                                           "float64", "enum",   "struct", "text"};
  std::string name = kNames[static_cast<int>(field.kind)];
  if (field.kind == Kind::structure) {
    name = "{";
    for (const auto& [inner, line] : fields_of(schema, field.type))
      name += inner + ": " + line + "; ";
    return name + "}";
  }
  if (field.kind == Kind::enumeration) {
    name += "(";
    for (std::uint32_t i = 0; i < field.labels; ++i) {
      const LabelRow& label = schema.labels[field.first_label + i];
      name += (i == 0 ? "" : ", ") + label.name.str() + " = " + std::to_string(label.value);
    }
    name += ")";
  }
  return name;
}

using Lines = std::map<std::string, std::string>;

std::string limits_of(const Schema& schema, const ActuatorRow& actuator) {
  std::string text;
  for (std::uint32_t i = 0; i < actuator.limits; ++i) {
    const LimitRow& limit = schema.limits[actuator.first_limit + i];
    text += (i == 0 ? "" : "; ") + number(limit.minimum) + " to " + number(limit.maximum) + " at " +
            number(limit.speed) + "/s";
  }
  return text;
}

/// A schema as lines that can be compared one by one, by what they speak of.
Lines lines_of(const Schema& schema) {
  Lines lines;
  lines["robot"] = schema.head.robot.str();
  lines["period"] = std::to_string(schema.head.period) + " ns";
  lines["clock"] = schema.head.clock == Clock::simulated ? "simulated" : "monotonic";
  lines["bursting"] = schema.head.bursting != 0 ? "yes" : "no";
  lines["size of a row's states"] = std::to_string(schema.head.block);
  lines["actuators"] = std::to_string(schema.actuators.size());
  for (std::size_t i = 0; i < schema.actuators.size(); ++i) {
    const ActuatorRow& actuator = schema.actuators[i];
    const std::string name = "actuator " + std::to_string(i) + " ";
    lines[name + "name"] = actuator.name.str();
    lines[name + "when_idle"] = actuator.when_idle == WhenIdle::hold ? "hold" : "follow";
    lines[name + "limits"] = limits_of(schema, actuator);
    lines[name + "offset"] = std::to_string(actuator.offset);
    for (const auto& [field, line] : fields_of(schema, actuator.type)) {
      lines[name + "field '" + field + "'"] = line;
    }
  }
  for (const auto& [field, line] : fields_of(schema, schema.head.extended)) {
    lines["extended field '" + field + "'"] = line;
  }
  for (const RequestRow& request : schema.requests) {
    const std::string name = "request '" + request.name.str() + "'";
    lines[name] = "there";
    for (const auto& [field, line] : fields_of(schema, request.type)) {
      lines[name + " field '" + field + "'"] = line;
    }
  }
  return lines;
}

}  // namespace

std::string difference(const Schema& expected, const Schema& found) {
  if (expected == found) return "";
  const Lines a = lines_of(expected);
  const Lines b = lines_of(found);
  std::string text;
  for (const auto& [what, line] : a) {
    const auto other = b.find(what);
    if (other == b.end()) {
      text += "  " + what + ": expected " + line + ", found nothing\n";
    } else if (other->second != line) {
      text += "  " + what + ": expected " + line + ", found " + other->second + "\n";
    }
  }
  for (const auto& [what, line] : b) {
    if (!a.contains(what)) text += "  " + what + ": expected nothing, found " + line + "\n";
  }
  return text.empty() ? "  help texts or groups differ\n" : text;
}

}  // namespace o80
