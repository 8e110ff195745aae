#include "describe/number_name.hpp"

namespace o80 {

NumberName name_at(const Schema& schema, std::uint32_t type, std::uint32_t offset) {
  const TypeRow& row = schema.types.at(type);
  for (std::uint32_t i = 0; i < row.fields; ++i) {
    const FieldRow& field = schema.fields.at(row.first_field + i);
    const std::uint32_t end = field.offset + field.size * field.count();
    if (offset < field.offset || offset >= end) continue;

    const std::uint32_t element = (offset - field.offset) / field.size;
    NumberName name{field.name.str(), &field};
    if (field.columns != 0) {
      name.path += "[" + std::to_string(element / field.columns) + "][" +
                   std::to_string(element % field.columns) + "]";
    } else if (field.rows != 0) {
      name.path += "[" + std::to_string(element) + "]";
    }
    if (field.kind != Kind::structure) return name;
    const std::uint32_t inside = offset - field.offset - element * field.size;
    const NumberName inner = name_at(schema, field.type, inside);
    if (!inner.path.empty()) name.path += (name.path.empty() ? "" : ".") + inner.path;
    name.field = inner.field;
    return name;
  }
  return {};
}

}  // namespace o80
