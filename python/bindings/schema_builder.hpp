#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "o80/describe/schema.hpp"
#include "o80/runtime/observation.hpp"

/// A schema that Python code fills.
struct SchemaBuilder {
  o80::Schema schema;

  explicit SchemaBuilder(const std::string& robot) { schema.head.robot = o80::NameText(robot); }

  /// Adds a type with these fields, each described as tables_of() does, with `index` in place of
  /// `type`. What is left out, also the size, is that of a C++ struct.
  std::uint32_t add_type(const std::string& name, const nanobind::list& fields, std::uint32_t size,
                         bool blends);

  /// The hash and the bytes of a face; see o80/describe/face.hpp. Throws InvalidArgument.
  nanobind::bytes face(std::int64_t period);

  /// The schema as readers see it.
  std::shared_ptr<o80::Description> description() const;

 private:
  o80::FieldRow member(const nanobind::dict& given);
  void add_labels(o80::FieldRow& field, const nanobind::dict& labels);
};

/// From its name in kKindNames. Throws InvalidArgument.
o80::Kind kind_of(const std::string& name);
void bind_schema_builder(nanobind::module_& m);
