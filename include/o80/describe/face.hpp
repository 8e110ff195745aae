#pragma once

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "o80/describe/schema.hpp"

namespace o80 {

/// The described side of a robot (groups, states, limits, sensor values, requests), as a field of a
/// Config: a simulator takes the face of another robot. Users give a robot's name, a segment, a
/// recording or a file; o80's Python makes a text of it, so that a replay needs nothing else.
struct Face {
  Schema schema;  // of the other robot, with its period; empty if the option is not given
  bool empty() const { return schema.actuators.empty() && schema.head.extended == kNoType; }
};
inline constexpr std::string_view kFaceKind = "face";

namespace describing {

/// Reads the fields of a line of the text, separated by tabs. Throws InvalidArgument.
class FaceLine {
 public:
  explicit FaceLine(std::string_view line) : rest_(line) {}

  template <class... Values>
  void operator()(Values&... values) {
    (read(values), ...);
  }
  std::string_view text() {
    const auto tab = rest_.find('\t');
    const std::string_view found = rest_.substr(0, tab);
    rest_.remove_prefix(tab == std::string_view::npos ? rest_.size() : tab + 1);
    return found;
  }

 private:
  template <std::size_t Size>
  void read(FixedText<Size>& value) {
    value = FixedText<Size>(text());
  }
  template <class T>
  void read(T& value) {
    if constexpr (std::is_enum_v<T>) {
      std::underlying_type_t<T> number{};
      read(number);
      value = static_cast<T>(number);
    } else {
      const std::string_view digits = text();
      const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), value);
      if (read.ec == std::errc() && read.ptr == digits.data() + digits.size()) return;
      throw InvalidArgument("'" + std::string(digits) + "' must be a number in the text of a face");
    }
  }

  std::string_view rest_;
};

inline constexpr std::uint32_t kLargestInFace = 1U << 24;  // type or block [bytes]

/// Throws InvalidArgument unless the fields of a type lie in it, beside each other: drivers walk
/// through a face before o80 checks what they describe.
inline void check_face_type(const Schema& schema, const TypeRow& type) {
  std::uint64_t used = 0;
  for (std::uint32_t i = type.first_field; i < type.first_field + type.fields; ++i) {
    const FieldRow& field = schema.fields[i];
    const bool is_enum = field.kind == Kind::enumeration && field.size > 0 && field.size <= 8;
    const std::uint32_t size = field.kind == Kind::structure ? schema.types.at(field.type).size
                               : is_enum                     ? field.size
                                                             : size_of(field.kind);
    // each factor is at most 2^24, so that no product overflows
    const std::uint64_t rows = std::max(1U, std::min(field.rows, kLargestInFace));
    const std::uint64_t columns = std::max(1U, std::min(field.columns, kLargestInFace));
    const std::uint64_t bytes = rows * columns;
    used += bytes > kLargestInFace ? kLargestInFace + 1 : bytes * std::max(1U, size);
    const bool lies_in_it = field.offset + bytes * std::uint64_t{size} <= type.size;
    if (size == field.size && (size > 0 || field.kind == Kind::structure) && lies_in_it &&
        used <= std::max(1U, type.size)) {
      continue;
    }
    throw InvalidArgument("field '" + field.name.str() + "' of the face does not fit its type");
  }
}

/// Adds what a line says to a schema.
inline void read_face_line(FaceLine line, Schema& schema) {
  const auto known_type = [&](std::uint32_t type) {
    if (type >= schema.types.size()) throw InvalidArgument("a type is missing in the face");
    return type;
  };
  NameText name;
  std::uint32_t number = 0;
  const std::string_view what = line.text();
  if (what == "face") {
    line(number, schema.head.robot, schema.head.period, schema.head.block);
    if (number != 1) throw InvalidArgument("the face is of another version of o80");
    const std::int64_t period = schema.head.period;
    if (period != 0 && (period < 1'000 || period > 1'000'000'000'000)) {
      throw InvalidArgument("the period of the face must be from 1000 to 1e12 ns, or 0, got " +
                            std::to_string(period));
    }
  } else if (what == "field") {  // of the type that follows
    FieldRow& field = schema.fields.emplace_back();
    line(field.name, field.kind, field.offset, field.size, field.rows, field.columns, field.type,
         field.is_signed, field.has_default, field.origin, field.resting, field.rest, field.unit,
         field.help);
    if (field.kind == Kind::structure) (void)known_type(field.type);
    field.first_label = static_cast<std::uint32_t>(schema.labels.size());
  } else if (what == "label") {  // of the field before
    LabelRow& label = schema.labels.emplace_back();
    line(label.name, label.value);
    ++schema.fields.at(schema.fields.size() - 1).labels;
  } else if (what == "type") {
    TypeRow& type = schema.types.emplace_back();
    line(type.name, type.size, type.alignment, type.fields);
    if (type.fields > schema.fields.size()) throw InvalidArgument("a field is missing in the face");
    type.first_field = static_cast<std::uint32_t>(schema.fields.size()) - type.fields;
    if (type.size > kLargestInFace) throw InvalidArgument("a type of the face is too large");
    check_face_type(schema, type);
    schema.hooks.emplace_back();
    schema.keys.push_back(nullptr);
  } else if (what == "default") {  // a byte of the default values of the type before
    TypeRow& type = schema.types.at(schema.types.size() - 1);
    const auto first = static_cast<std::uint32_t>(schema.defaults.size());
    if (type.first_default == kNoType) type.first_default = first;
    line(number);
    schema.defaults.push_back(static_cast<std::byte>(number));
  } else if (what == "group") {
    std::uint32_t type = 0;
    std::uint32_t offset = 0;
    std::uint32_t is_array = 0;
    line(name, type, offset, number, is_array);
    const std::uint64_t size = schema.types[known_type(type)].size;
    if (offset + number * size > schema.head.block || schema.head.block > kLargestInFace ||
        number > 0xFFFF) {
      throw InvalidArgument("a group of the face does not fit its states");
    }
    schema.place_group(name.view(), known_type(type), offset, number, is_array != 0);
  } else if (what == "actuator") {
    line(number);
    ActuatorRow& actuator = schema.actuators.at(number);
    line(actuator.name, actuator.when_idle);
  } else if (what == "limit") {
    line(number);
    LimitRow& limit = schema.limits.at(number);
    line(limit.minimum, limit.maximum, limit.speed, limit.acceleration, limit.jerk, limit.error,
         limit.rest, limit.resting, limit.noise);
  } else if (what == "integral") {
    IntegralRow& row = schema.integrals.emplace_back();
    line(row.limit, row.number, row.minimum, row.maximum, row.reaction);
  } else if (what == "extended") {
    line(number);
    schema.head.extended = known_type(number);
  } else if (what == "request") {
    RequestRow& request = schema.requests.emplace_back();
    line(request.name, request.type, request.while_halted, request.help);
  } else {
    throw InvalidArgument(
        "'" + std::string(what.substr(0, 40)) +
        "' is not the text of a face: give a robot's name to `o80 run` or o80.robots");
  }
}

/// The schema of a text: lines of tables, types before what uses them (python/o80/robots/face.py
/// writes it). o80 checks the description that a robot makes of it.
inline Schema face_from(std::string_view text) {
  Schema schema;
  while (!text.empty()) {
    const auto end = text.find('\n');
    try {
      read_face_line(FaceLine(text.substr(0, end)), schema);
    } catch (const std::out_of_range&) {
      throw InvalidArgument("a row is missing in the face");
    }
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return schema;
}

}  // namespace describing
}  // namespace o80
