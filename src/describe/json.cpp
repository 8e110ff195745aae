#include <cmath>
#include <iomanip>
#include <sstream>

#include "o80/describe/layout.hpp"
#include "o80/describe/table.hpp"

namespace o80 {

namespace {

/// Writes JSON; commas are set where they belong.
class JsonWriter {
 public:
  void open(char bracket) {
    separate();
    text_ << bracket;
    first_ = true;
  }
  void close(char bracket) {
    text_ << bracket;
    first_ = false;
  }
  void key(std::string_view name) {
    separate();
    quote(name);
    text_ << ": ";
    after_key_ = true;
  }
  void value(std::string_view text) {
    separate();
    quote(text);
  }
  void value(bool yes) {
    separate();
    text_ << (yes ? "true" : "false");
  }
  void value(std::int64_t number) {
    separate();
    text_ << number;
  }
  void value(double number) {
    separate();
    if (std::isfinite(number)) {
      text_ << std::setprecision(17) << number;
    } else {
      text_ << "null";
    }
  }
  std::string str() const { return text_.str(); }

 private:
  void separate() {
    if (!first_ && !after_key_) text_ << ", ";
    first_ = false;
    after_key_ = false;
  }
  void quote(std::string_view text) {
    text_ << '"';
    for (const char c : text) {
      if (c == '"' || c == '\\') {
        text_ << '\\' << c;
      } else if (static_cast<unsigned char>(c) < 32) {
        text_ << "\\u" << std::hex << std::setw(4) << std::setfill('0') << static_cast<int>(c)
              << std::dec;
      } else {
        text_ << c;
      }
    }
    text_ << '"';
  }

  std::ostringstream text_;
  bool first_ = true;
  bool after_key_ = false;
};

constexpr const char* kKinds[] = {"bool",    "int8",   "int16",  "int32",  "int64",
                                  "uint8",   "uint16", "uint32", "uint64", "float32",
                                  "float64", "enum",   "struct", "text"};

void write_type(JsonWriter& json, const Schema& schema, std::uint32_t index);

void write_field(JsonWriter& json, const Schema& schema, const FieldRow& field) {
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
  json.key("fields");
  json.open('[');
  for (std::uint32_t i = 0; i < type.fields; ++i) {
    write_field(json, schema, schema.fields[type.first_field + i]);
  }
  json.close(']');
  json.close('}');
}

void write_actuator(JsonWriter& json, const Schema& schema, const ActuatorRow& actuator) {
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
    json.key("minimum");
    json.value(limit.minimum);
    json.key("maximum");
    json.value(limit.maximum);
    json.key("speed");
    json.value(limit.speed);
    json.key("acceleration");
    json.value(limit.acceleration);
    json.key("jerk");
    json.value(limit.jerk);
    json.key("error");
    json.value(limit.error);
    if (limit.resting != 0) {
      json.key("rest");
      json.value(limit.rest);
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
  json.close('}');
  return json.str();
}

}  // namespace o80
