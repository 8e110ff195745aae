#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "nb.hpp"
#include "o80/describe/schema.hpp"
#include "o80/runtime/observation.hpp"

/// A schema that Python code fills.
struct SchemaBuilder {
  o80::Schema schema;

  explicit SchemaBuilder(const std::string& robot) { schema.head.robot = o80::NameText(robot); }

  /// Adds a type with these fields, each described as tables_of() does, with `index` in place of
  /// `type`. What is left out, also the size, is that of a C++ struct.
  std::uint32_t add_type(const std::string& name, const nb::list& fields, std::uint32_t size,
                         bool blends);

  void set_block(std::uint32_t offset) { schema.head.block = offset; }
  void set_extended(std::uint32_t type) { schema.head.extended = type; }
  void set_gap(std::int64_t longest) { schema.gap(longest); }
  void name_actuator(std::uint32_t i, const std::string& name) { schema.actuator(i).name(name); }
  void set_follow(std::uint32_t i) { schema.actuator(i).when_idle(o80::WhenIdle::follow); }
  void rests_at(std::uint32_t i, const std::string& field, double value) {
    schema.actuator(i).rests_at(field, value);
  }
  void add_integral(std::uint32_t limit, std::uint32_t number, const std::array<double, 3>& given) {
    schema.integrals.push_back({limit, number, given[0], given[1], given[2]});
  }
  void set_model(const std::string& mjcf, const std::string& file) {
    schema.shown.mjcf = mjcf;
    schema.shown.file = file;
  }
  void moves_joint(std::uint32_t i, const std::string& joint) {
    schema.actuator(i).moves_joint(joint);
  }
  void sensor_moves_joint(const std::string& field, std::uint32_t index, const std::string& joint) {
    schema.sensor_moves_joint(field, index, joint);
  }

  /// The hash and the bytes of a face; see o80/describe/face.hpp. Throws InvalidArgument.
  nb::bytes face(std::int64_t period);

  /// The schema as readers see it.
  std::shared_ptr<o80::Description> description() const;

 private:
  o80::FieldRow member(const nb::dict& given);
  void add_labels(o80::FieldRow& field, const nb::dict& labels);
};

/// From its name in kKindNames. Throws InvalidArgument.
o80::Kind kind_of(const std::string& name);
void bind_schema_builder(nb::module_& m);
