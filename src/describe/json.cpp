#include <algorithm>
#include <cstring>

#include "describe/json_writer.hpp"
#include "describe/table.hpp"
#include "o80/describe/layout.hpp"

namespace o80 {

namespace {

constexpr const char* kKinds[] = {"bool",    "int8",   "int16",  "int32",  "int64",
                                  "uint8",   "uint16", "uint32", "uint64", "float32",
                                  "float64", "enum",   "struct", "text"};

void write_type(JsonWriter& json, const Schema& schema, std::uint32_t index);

template <class T>
T number_at(const std::byte* from) {
  T number;
  std::memcpy(&number, from, sizeof number);
  return number;
}

/// An integer of 1 to 8 bytes.
void write_integer(JsonWriter& json, const std::byte* from, std::uint32_t size, bool is_signed) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, from, size);  // little-endian
  if (!is_signed) return json.value(bits);
  const std::uint32_t unused = 64 - 8 * size;
  json.value(static_cast<std::int64_t>(bits << unused) >> unused);
}

void write_value(JsonWriter& json, const Schema& schema, const FieldRow& field,
                 const std::byte* from);

void write_element(JsonWriter& json, const Schema& schema, const FieldRow& field,
                   const std::byte* from) {
  switch (field.kind) {
    case Kind::structure: {
      const TypeRow& type = schema.types[field.type];
      json.open('{');
      for (std::uint32_t i = 0; i < type.fields; ++i) {
        const FieldRow& member = schema.fields[type.first_field + i];
        json.key(member.name.view());
        write_value(json, schema, member, from + member.offset);
      }
      return json.close('}');
    }
    case Kind::boolean:
      return json.value(number_at<std::uint8_t>(from) != 0);
    case Kind::float32:
      return json.value(double{number_at<float>(from)});
    case Kind::float64:
      return json.value(number_at<double>(from));
    case Kind::enumeration:
      return write_integer(json, from, field.size, field.is_signed != 0);
    default:
      return write_integer(json, from, field.size, field.kind < Kind::uint8);
  }
}

/// The value of a field; an array field becomes a JSON array.
void write_value(JsonWriter& json, const Schema& schema, const FieldRow& field,
                 const std::byte* from) {
  if (field.rows == 0) return write_element(json, schema, field, from);
  json.open('[');
  for (std::uint32_t i = 0; i < field.rows; ++i) {
    if (field.columns != 0) json.open('[');
    for (std::uint32_t j = 0; j < std::max(field.columns, 1U); ++j) {
      write_element(json, schema, field, from);
      from += field.size;
    }
    if (field.columns != 0) json.close(']');
  }
  json.close(']');
}

void write_field(JsonWriter& json, const Schema& schema, const TypeRow& type,
                 const FieldRow& field) {
  json.open('{');
  json.key("name");
  json.value(field.name.view());
  json.key("kind");
  json.value(std::string_view(kKinds[static_cast<int>(field.kind)]));
  json.key("offset");
  json.value(std::int64_t{field.offset});
  json.key("size");
  json.value(std::int64_t{field.size});
  json.key("shape");
  json.open('[');
  if (field.rows != 0) json.value(std::int64_t{field.rows});
  if (field.columns != 0) json.value(std::int64_t{field.columns});
  json.close(']');
  json.key("unit");
  json.value(field.unit.view());
  json.key("help");
  json.value(field.help.view());
  if (field.resting != 0) {
    json.key("rest");
    json.value(field.rest);
  }
  if (field.origin != Origin::robot) {
    json.key("origin");
    json.value(std::string_view(field.origin == Origin::clock ? "clock" : "world"));
  }
  if (field.has_default != 0) {
    json.key("default");
    write_value(json, schema, field, schema.defaults.data() + type.first_default + field.offset);
  }
  if (field.kind == Kind::enumeration) {
    json.key("signed");
    json.value(field.is_signed != 0);
    json.key("labels");
    json.open('{');
    for (std::uint32_t i = 0; i < field.labels; ++i) {
      json.key(schema.labels[field.first_label + i].name.view());
      json.value(schema.labels[field.first_label + i].value);
    }
    json.close('}');
  }
  if (field.kind == Kind::structure) {
    json.key("type");
    write_type(json, schema, field.type);
  }
  json.close('}');
}

void write_type(JsonWriter& json, const Schema& schema, std::uint32_t index) {
  const TypeRow& type = schema.types[index];
  json.open('{');
  json.key("name");
  json.value(type.name.view());
  json.key("size");
  json.value(std::int64_t{type.size});
  if (type.blends != 0) {
    json.key("blends");
    json.value(true);
  }
  json.key("fields");
  json.open('[');
  for (std::uint32_t i = 0; i < type.fields; ++i) {
    write_field(json, schema, type, schema.fields[type.first_field + i]);
  }
  json.close(']');
  json.close('}');
}

void write_actuator(JsonWriter& json, const Schema& schema, const ActuatorRow& actuator) {
  const auto put = [&](std::string_view name, double value) {
    json.key(name);
    json.value(value);
  };
  json.open('{');
  json.key("name");
  json.value(actuator.name.view());
  json.key("offset");
  json.value(std::int64_t{actuator.offset});
  json.key("when_idle");
  json.value(std::string_view(actuator.when_idle == WhenIdle::hold ? "hold" : "follow"));
  json.key("group");
  json.value(std::int64_t{actuator.group});
  json.key("limits");
  json.open('[');
  for (std::uint32_t i = 0; i < actuator.limits; ++i) {
    const LimitRow& limit = schema.limits[actuator.first_limit + i];
    json.open('{');
    put("minimum", limit.minimum);
    put("maximum", limit.maximum);
    put("speed", limit.speed);
    put("acceleration", limit.acceleration);
    put("jerk", limit.jerk);
    put("error", limit.error);
    if (limit.noise != 0.0F) {
      json.key("noise");
      json.value(limit.noise);
    }
    if (limit.resting != 0) put("rest", limit.rest);
    for (const IntegralRow& row : schema.integrals) {
      if (row.limit != actuator.first_limit + i) continue;
      json.key("integral");
      json.open('{');
      json.key("number");
      json.value(std::int64_t{row.number});
      put("minimum", row.minimum);
      put("maximum", row.maximum);
      put("reaction", row.reaction);
      json.close('}');
    }
    json.close('}');
  }
  json.close(']');
  json.close('}');
}

void write_layout(JsonWriter& json, const RowLayout& layout) {
  json.open('{');
  const auto put = [&](std::string_view name, std::uint32_t value) {
    json.key(name);
    json.value(std::int64_t{value});
  };
  put("size", layout.size);
  put("iteration", 0);
  put("time", 8);
  put("lateness", 16);
  put("overruns", 24);
  put("skipped", 28);
  put("fresh", 32);
  put("halted", 36);
  put("desired", layout.desired);
  put("observed", layout.observed);
  put("extended", layout.extended);
  put("active", layout.active);
  put("clamped", layout.clamped);
  put("braking", layout.braking);
  put("mask_words", layout.mask_words);
  put("extended_size", layout.extended_size);
  json.close('}');
}

/// Without the text of the model, which is long.
void write_shown(JsonWriter& json, const ShownModel& shown) {
  json.open('{');
  json.key("file");
  json.value(std::string_view(shown.file));
  json.key("bytes");
  json.value(static_cast<std::int64_t>(shown.mjcf.size()));
  json.key("values");
  json.open('[');
  for (const ShownRow& row : shown.values) {
    json.open('{');
    json.key("name");
    json.value(row.name.view());
    json.key("what");
    json.value(std::string_view(row.what == Shown::joint ? "joint" : "position"));
    json.key("from");
    json.value(std::string_view(row.from == ShownFrom::states ? "states" : "extended"));
    json.key("offset");
    json.value(std::int64_t{row.offset});
    json.close('}');
  }
  json.close(']');
  json.close('}');
}

}  // namespace

std::string to_json(const Schema& schema) {
  JsonWriter json;
  json.open('{');
  json.key("robot");
  json.value(schema.head.robot.view());
  json.key("period");
  json.value(schema.head.period);
  json.key("clock");
  json.value(std::string_view(schema.head.clock == Clock::simulated ? "simulated" : "monotonic"));
  json.key("bursting");
  json.value(schema.head.bursting != 0);
  json.key("silence");
  json.value(schema.head.silence);
  json.key("stale");
  json.value(name_of(schema.head.stale));
  json.key("of_the_world");
  json.value(schema.head.of_the_world != 0);
  if (schema.head.gap != 0) {
    json.key("gap");
    json.value(schema.head.gap * 1e-6);
  }
  json.key("row");
  write_layout(json, row_layout(schema));
  json.key("groups");
  json.open('[');
  for (const GroupRow& group : schema.groups) {
    json.open('{');
    json.key("name");
    json.value(group.name.view());
    json.key("array");
    json.value(group.is_array != 0);
    json.key("offset");
    json.value(std::int64_t{group.offset});
    json.key("first_actuator");
    json.value(std::int64_t{group.first_actuator});
    json.key("count");
    json.value(std::int64_t{group.count});
    json.key("type");
    write_type(json, schema, group.type);
    json.close('}');
  }
  json.close(']');
  json.key("actuators");
  json.open('[');
  for (const ActuatorRow& actuator : schema.actuators) write_actuator(json, schema, actuator);
  json.close(']');
  if (schema.head.extended != kNoType) {
    json.key("extended");
    write_type(json, schema, schema.head.extended);
  }
  json.key("requests");
  json.open('[');
  for (const RequestRow& request : schema.requests) {
    json.open('{');
    json.key("name");
    json.value(request.name.view());
    json.key("help");
    json.value(request.help.view());
    json.key("type");
    write_type(json, schema, request.type);
    json.key("while_halted");
    json.value(request.while_halted != 0);
    json.close('}');
  }
  json.close(']');
  if (!schema.shown.empty()) {
    json.key("model");
    write_shown(json, schema.shown);
  }
  json.close('}');
  return json.str();
}

}  // namespace o80
