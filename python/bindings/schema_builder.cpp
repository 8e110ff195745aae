#include "schema_builder.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cstddef>
#include <iterator>
#include <utility>

#include "arguments.hpp"
#include "o80/base/error.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using o80::InvalidArgument;

namespace {

o80::Kind kind_of(const std::string& name) {
  using o80::Kind;
  constexpr const char* kNames[] = {"bool",    "int8",   "int16",  "int32",  "int64",
                                    "uint8",   "uint16", "uint32", "uint64", "float32",
                                    "float64", "enum",   "struct"};
  for (std::size_t i = 0; i < std::size(kNames); ++i) {
    if (name == kNames[i]) return static_cast<Kind>(i);
  }
  throw InvalidArgument("a field must be a number, a boolean, an enum or a struct, got '" + name +
                        "'");
}

}  // namespace

std::uint32_t SchemaBuilder::add_type(const std::string& name, const nb::list& fields) {
  std::vector<o80::FieldRow> members;
  for (nb::handle each : fields) members.push_back(member(nb::cast<nb::tuple>(each)));
  return schema.add_type(name, std::move(members));
}

o80::FieldRow SchemaBuilder::member(const nb::tuple& row) {
  const std::string name = string_of(row[0], "the name of a field");
  const auto shape = nb::cast<std::vector<std::uint32_t>>(row[2]);
  if (shape.size() > 2) {
    throw InvalidArgument("field '" + name + "' has " + std::to_string(shape.size()) +
                          " dimensions: at most 2 can be described");
  }
  o80::FieldRow field = o80::scalar_field(name, kind_of(nb::cast<std::string>(row[1])),
                                          string_of(row[3], "the unit of a field"));
  if (!shape.empty()) field.rows = shape[0];
  if (shape.size() == 2) field.columns = shape[1];
  if (field.kind == o80::Kind::structure) field.type = nb::cast<std::uint32_t>(row[5]);
  if (field.kind == o80::Kind::enumeration) add_labels(field, nb::cast<nb::dict>(row[4]));
  return field;
}

void SchemaBuilder::add_labels(o80::FieldRow& field, const nb::dict& labels) {
  field.size = 8;
  field.is_signed = 1;
  field.first_label = static_cast<std::uint32_t>(schema.labels.size());
  field.labels = static_cast<std::uint32_t>(labels.size());
  for (const auto& [name, value] : labels) {
    schema.labels.push_back(
        {o80::NameText(string_of(name, "a label")), nb::cast<std::int64_t>(value)});
  }
}

std::shared_ptr<o80::Description> SchemaBuilder::description() const {
  auto description = std::make_shared<o80::Description>();
  description->schema = schema;
  description->schema.head.block = o80::round_up(schema.head.block, 8);
  description->layout = o80::row_layout(description->schema);
  return description;
}

void bind_schema_builder(nb::module_& m) {
  nb::class_<SchemaBuilder>(m, "SchemaBuilder", "The schema of a robot under construction.")
      .def(nb::init<const std::string&>(), "robot"_a)
      .def("add_type", &SchemaBuilder::add_type, "name"_a, "fields"_a,
           nb::sig("def add_type(self, name: str, fields: list[typing.Any]) -> int"))
      .def("add_actuators", &SchemaBuilder::add_actuators, "group"_a, "type"_a, "count"_a,
           "is_array"_a)
      .def("set_extended", &SchemaBuilder::set_extended, "type"_a)
      .def("add_request", &SchemaBuilder::add_request, "name"_a, "type"_a, "help"_a,
           "while_halted"_a)
      .def("name_actuator", &SchemaBuilder::name_actuator, "actuator"_a, "name"_a)
      .def("set_follow", &SchemaBuilder::set_follow, "actuator"_a)
      .def("set_limits", &SchemaBuilder::set_limits, "actuator"_a, "field"_a, "limits"_a,
           "integral"_a, "bounds"_a)
      .def("rests_at", &SchemaBuilder::rests_at, "actuator"_a, "field"_a, "value"_a)
      .def("simulated", &SchemaBuilder::simulated)
      .def("gap", &SchemaBuilder::gap, "longest"_a)
      .def("description", &SchemaBuilder::description)
      .def("set_model", &SchemaBuilder::set_model, "mjcf"_a, "file"_a)
      .def("moves_joint", &SchemaBuilder::moves_joint, "actuator"_a, "joint"_a)
      .def("sensor_moves_joint", &SchemaBuilder::sensor_moves_joint, "field"_a, "index"_a,
           "joint"_a)
      .def_prop_ro("actuators", &SchemaBuilder::actuators);
}
