#include <map>
#include <sstream>

#include "describe/table.hpp"
#include "describe/visit_number.hpp"

namespace o80 {

namespace {

using Lines = std::map<std::string, std::string>;  // property => value

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

/// "float64 at byte 0" for every field, by name.
Lines fields_of(const Schema& schema, std::uint32_t type) {
  Lines lines;
  if (type == kNoType) return lines;
  const TypeRow& row = schema.types[type];
  for (std::uint32_t i = 0; i < row.fields; ++i) {
    const FieldRow& field = schema.fields[row.first_field + i];
    lines[field.name.str()] =
        kind_name(schema, field) + shape(field) + " at byte " + std::to_string(field.offset);
  }
  return lines;
}

std::string kind_name(const Schema& schema, const FieldRow& field) {
  std::string name = kKindNames[static_cast<int>(field.kind)];
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

std::string limits_of(const Schema& schema, const ActuatorRow& actuator) {
  std::string text;
  for (std::uint32_t i = 0; i < actuator.limits; ++i) {
    const LimitRow& limit = schema.limits[actuator.first_limit + i];
    text += (i == 0 ? "" : "; ") + number(limit.minimum) + " to " + number(limit.maximum) + " at " +
            number(limit.speed) + "/s, " + number(limit.acceleration) + "/s^2, " +
            number(limit.jerk) + "/s^3, error " + number(limit.error) +
            (limit.noise != 0.0F ? ", noise " + number(limit.noise) : "") +
            (limit.resting != 0 ? ", rests at " + number(limit.rest) : "");
  }
  for (const IntegralRow& row : schema.integrals) {
    if (row.limit - actuator.first_limit >= actuator.limits) continue;
    text += "; integral of " + std::to_string(row.limit - actuator.first_limit) + " is " +
            std::to_string(row.number) + ", " + number(row.minimum) + " to " + number(row.maximum) +
            ", reaction " + number(row.reaction) + " s";
  }
  return text;
}

constexpr std::size_t kShown = 5;            // differences, of all that there are
constexpr std::string_view kUnit = " unit";  // ends the names of lines that give a unit

void add_fields(Lines& lines, const std::string& of, const Schema& schema, std::uint32_t type) {
  const auto name = [&](const std::string& field) {
    return of + "field" + (field.empty() ? "" : " '" + field + "'");
  };
  for (const auto& [field, line] : fields_of(schema, type)) lines[name(field)] = line;
  for (std::uint32_t i = 0; type != kNoType && i < schema.types[type].fields; ++i) {
    const FieldRow& field = schema.fields[schema.types[type].first_field + i];
    if (field.unit.view().empty()) continue;
    lines[name(field.name.str()) + std::string(kUnit)] = "[" + field.unit.str() + "]";
  }
}

/// The properties that compiled code depends on.
Lines layout_lines(const Schema& schema) {
  Lines lines;
  lines["size of a row's states"] = std::to_string(round_up(schema.head.block, 8));
  lines["actuators"] = std::to_string(schema.actuators.size());
  for (std::size_t i = 0; i < schema.actuators.size(); ++i) {
    const ActuatorRow& actuator = schema.actuators[i];
    const std::string name = "actuator " + std::to_string(i) + " ";
    lines[name + "offset"] = std::to_string(actuator.offset);
    add_fields(lines, name, schema, actuator.type);
  }
  add_fields(lines, "extended ", schema, schema.head.extended);
  for (const RequestRow& request : schema.requests) {
    const std::string name = "request '" + request.name.str() + "'";
    lines[name] = "there";
    add_fields(lines, name + " ", schema, request.type);
  }
  return lines;
}

/// All properties of a schema, without help texts.
Lines lines_of(const Schema& schema) {
  Lines lines = layout_lines(schema);
  lines["robot"] = schema.head.robot.str();
  lines["period"] = std::to_string(schema.head.period) + " ns";
  lines["clock"] = schema.head.clock == Clock::simulated ? "simulated" : "monotonic";
  lines["bursting"] = schema.head.bursting != 0 ? "yes" : "no";
  for (std::size_t i = 0; i < schema.actuators.size(); ++i) {
    const ActuatorRow& actuator = schema.actuators[i];
    const std::string name = "actuator " + std::to_string(i) + " ";
    lines[name + "name"] = actuator.name.str();
    lines[name + "when_idle"] = actuator.when_idle == WhenIdle::hold ? "hold" : "follow";
    lines[name + "limits"] = limits_of(schema, actuator);
  }
  return lines;
}

/// What says most about two robots comes first; the size of a row follows from the rest.
int rank(std::string_view what) {
  if (what == "robot") return 0;
  if (what == "actuators") return 1;
  if (what.starts_with("actuator 0 ")) return 2;  // the others are often of the same type
  if (what.starts_with("size of")) return 5;
  return what.starts_with("actuator ") ? 4 : 3;
}

std::string compare(const Lines& expected, const Lines& found) {
  const auto value_in = [](const Lines& lines, const std::string& what) {
    const auto line = lines.find(what);
    return line == lines.end() ? std::string("nothing") : line->second;
  };
  Lines all = expected;
  all.insert(found.begin(), found.end());
  std::multimap<int, std::string> different;  // by rank
  for (const auto& [what, value] : all) {
    const std::string wanted = value_in(expected, what);
    const std::string there = value_in(found, what);
    if (wanted == there) continue;
    different.emplace(rank(what), "  " + what + ": expected " + wanted + ", found " + there + "\n");
  }
  std::string text;
  std::size_t shown = 0;
  for (auto each = different.begin(); each != different.end() && shown < kShown; ++each, ++shown) {
    text += each->second;
  }
  const std::size_t more = different.size() - shown;
  return more == 0 ? text : text + "  and " + std::to_string(more) + " more differences\n";
}

/// Drops lines that may be missing on one side: units, and requests that the program does not use.
void forgive(Lines& expected, Lines& found) {
  std::erase_if(expected, [&](const auto& line) {
    return line.first.ends_with(kUnit) && !found.contains(line.first);
  });
  std::erase_if(found, [&](const auto& line) {
    const bool may_miss = line.first.ends_with(kUnit) || line.first.starts_with("request ");
    return may_miss && !expected.contains(line.first);
  });
}

}  // namespace

std::string difference(const Schema& expected, const Schema& found) {
  // watchdog settings and the gap may differ, and the model that viewers draw
  Schema same = found;
  same.head.stale = expected.head.stale;
  same.head.silence = expected.head.silence;
  same.head.gap = expected.head.gap;
  same.shown = expected.shown;
  if (expected == same) return "";
  const std::string text = compare(lines_of(expected), lines_of(found));
  return text.empty() ? "  names of types, help texts or groups differ\n" : text;
}

std::string layout_difference(const Schema& expected, const Schema& found) {
  Lines wanted = layout_lines(expected);
  Lines there = layout_lines(found);
  forgive(wanted, there);
  return compare(wanted, there);
}

}  // namespace o80
