#include "schema_builder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <span>
#include <utility>

#include "arguments.hpp"
#include "buffer.hpp"
#include "describe/table.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/schema_bytes.hpp"
#include "schema_tables.hpp"
#include "states.hpp"

using o80::InvalidArgument;

o80::Kind kind_of(const std::string& name) {
  const auto* const last = std::begin(o80::kKindNames) + static_cast<int>(o80::Kind::text);
  const auto* const found = std::find(std::begin(o80::kKindNames), last, name);
  if (found != last) return static_cast<o80::Kind>(found - std::begin(o80::kKindNames));
  throw InvalidArgument("a field must be a number, a boolean, an enum or a struct, got '" + name +
                        "'");
}

namespace {

template <class T>
T value_of(const nb::dict& from, const char* key) {
  const nb::object given = from[key];  // raises KeyError
  T value;
  if (nb::try_cast<T>(given, value)) return value;
  throw InvalidArgument("'" + std::string(key) + "' of a field has the wrong type");
}
template <class T>
T value_of(const nb::dict& from, const char* key, T otherwise) {
  return from.contains(key) ? value_of<T>(from, key) : otherwise;
}

}  // namespace

std::uint32_t SchemaBuilder::add_type(const std::string& name, const nb::list& fields,
                                      std::uint32_t size, bool blends) {
  std::vector<o80::FieldRow> members;
  for (nb::handle each : fields) members.push_back(member(nb::cast<nb::dict>(each)));
  const std::uint32_t index = schema.add_type(name, std::move(members));
  o80::TypeRow& type = schema.types[index];
  type.blends = blends ? 1 : 0;
  if (size != 0) type.size = size;
  o80::FieldRow* const rows = schema.fields.data() + type.first_field;
  nb::dict defaults;
  for (std::uint32_t i = 0; i < type.fields; ++i) {
    const auto given = nb::cast<nb::dict>(fields[i]);
    rows[i].offset = value_of(given, "offset", rows[i].offset);
    if (!given.contains("default")) continue;
    const nb::object value = given["default"];  // None: not finite
    defaults[given["name"]] = value.is_none() ? nb::object(nb::float_(NAN)) : value;
  }
  if (defaults.size() == 0) return index;
  check(schema);  // what follows writes to the offsets
  const StateBytes values(schema, index, defaults, "the default of '" + name + "'");
  type.first_default = static_cast<std::uint32_t>(schema.defaults.size());
  schema.defaults.insert(schema.defaults.end(), values.bytes.begin(), values.bytes.end());
  for (std::uint32_t i = 0; i < type.fields; ++i) {
    rows[i].has_default = nb::cast<nb::dict>(fields[i]).contains("default") ? 1 : 0;
  }
  return index;
}

o80::FieldRow SchemaBuilder::member(const nb::dict& given) {
  o80::FieldRow field;
  field.name = o80::NameText(string_of(given["name"], "the name of a field"));
  if (given.contains("unit")) {
    field.unit = o80::UnitText(string_of(given["unit"], "the unit of a field"));
  }
  field.help = o80::FieldHelpText(value_of<std::string>(given, "help", ""));
  field.kind = kind_of(value_of<std::string>(given, "kind"));
  field.size = value_of(given, "size", size_of(field.kind));
  const auto shape = value_of<std::vector<std::uint32_t>>(given, "shape");
  if (shape.size() > 2) {
    throw InvalidArgument("field '" + field.name.str() + "' has " + std::to_string(shape.size()) +
                          " dimensions: at most 2 can be described");
  }
  if (!shape.empty()) field.rows = shape[0];
  if (shape.size() == 2) field.columns = shape[1];
  field.is_signed = value_of(given, "signed", false) ? 1 : 0;
  const auto origin = value_of<std::string>(given, "origin", "robot");
  const auto* const known = std::ranges::find(o80::kOriginNames, origin);
  field.origin = static_cast<o80::Origin>(known - std::begin(o80::kOriginNames));
  field.resting = given.contains("rest") ? 1 : 0;
  field.rest = value_of(given, "rest", 0.0);
  if (field.kind == o80::Kind::structure) field.type = value_of<std::uint32_t>(given, "index");
  if (field.kind == o80::Kind::enumeration) add_labels(field, value_of<nb::dict>(given, "labels"));
  return field;
}

void SchemaBuilder::add_labels(o80::FieldRow& field, const nb::dict& labels) {
  field.first_label = static_cast<std::uint32_t>(schema.labels.size());
  field.labels = static_cast<std::uint32_t>(labels.size());
  for (const auto& [name, value] : labels) {
    schema.labels.push_back(
        {o80::NameText(string_of(name, "a label")), count_of(value, "a label")});
  }
}

std::shared_ptr<o80::Description> SchemaBuilder::description() const {
  auto description = std::make_shared<o80::Description>();
  description->schema = schema;
  description->schema.head.block = o80::round_up(schema.head.block, 8);
  description->layout = o80::row_layout(description->schema);
  return description;
}

nb::bytes SchemaBuilder::face(std::int64_t period) {
  schema.head.period = period;
  schema.head.block = o80::round_up(schema.head.block, 8);
  check_face(schema);
  std::vector<std::byte> bytes = to_bytes(schema);
  const std::uint64_t hash = o80::describing::hash_of(bytes);
  const auto head = std::as_bytes(std::span(&hash, 1));
  bytes.insert(bytes.begin(), head.begin(), head.end());
  return bytes_of(bytes);
}

void bind_schema_builder(nb::module_& m) {
  using Self = SchemaBuilder;
  using std::string;
  using std::uint32_t;
  nb::class_<Self>(m, "SchemaBuilder", "The schema of a robot under construction.")
      .def(nb::init<const string&>(), "robot"_a)
      .def("add_type", &Self::add_type, "name"_a, "fields"_a, "size"_a = 0, "blends"_a = false,
           nb::sig("def add_type(self, name: str, fields: list[typing.Any], size: int = 0, "
                   "blends: bool = False) -> int"))
      .def(
          "add_actuators",
          [](Self& self, const string& group, uint32_t type, uint32_t count, bool is_array) {
            if (count >= 0xFFFF) throw InvalidArgument("a robot has fewer than 65535 actuators");
            return self.schema.add_actuators(group, type, count, is_array);
          },
          "group"_a, "type"_a, "count"_a, "is_array"_a)
      .def("set_block", &Self::set_block, "offset"_a, "The next group begins here [bytes].")
      .def("set_extended", &Self::set_extended, "type"_a)
      .def(
          "add_request",
          [](Self& self, const string& name, uint32_t type, const string& help, bool halted) {
            self.schema.add_request(name, type, help, halted);
          },
          "name"_a, "type"_a, "help"_a, "while_halted"_a)
      .def("name_actuator", &Self::name_actuator, "actuator"_a, "name"_a)
      .def("set_follow", &Self::set_follow, "actuator"_a)
      .def(
          "set_limits",
          [](Self& self, uint32_t i, const string& field, const std::array<double, 7>& given,
             const string& integral, const std::array<double, 3>& bounds) {
            o80::Limits limits{given[0], given[1], given[2], given[3],
                               given[4], given[5], given[6]};
            if (!integral.empty()) limits.integral = {integral, bounds[0], bounds[1], bounds[2]};
            self.schema.actuator(i).limits(field, limits);
          },
          "actuator"_a, "field"_a, "limits"_a, "integral"_a, "bounds"_a,
          "Limits of a field (empty: the first number), in the order of o80::Limits, and of its "
          "integral (empty: none), in the order of o80::IntegralBounds.")
      .def(
          "set_limit_row",
          [](Self& self, uint32_t i, const std::array<double, 7>& given, bool rests, float noise) {
            self.schema.limits.at(i) = {given[0], given[1], given[2],        given[3], given[4],
                                        given[5], given[6], rests ? 1U : 0U, noise};
          },
          "index"_a, "limits"_a, "rests"_a, "noise"_a,
          "Limits of a number of another robot, in the order of o80::LimitRow.")
      .def("add_integral", &Self::add_integral, "limit"_a, "number"_a, "bounds"_a)
      .def("rests_at", &Self::rests_at, "actuator"_a, "field"_a, "value"_a)
      .def("simulated", [](Self& self, bool is) { self.schema.head.of_the_world = is ? 2 : 3; })
      .def("gap", &Self::set_gap, "longest"_a)
      .def("set_model", &Self::set_model, "mjcf"_a, "file"_a)
      .def("moves_joint", &Self::moves_joint, "actuator"_a, "joint"_a)
      .def("sensor_moves_joint", &Self::sensor_moves_joint, "field"_a, "index"_a, "joint"_a)
      .def("description", &Self::description)
      .def("face", &Self::face, "period"_a)
      .def_prop_ro("actuators", [](const Self& self) {
        std::vector<string> names;
        for (const o80::ActuatorRow& row : self.schema.actuators) names.push_back(row.name.str());
        return names;
      });
}
