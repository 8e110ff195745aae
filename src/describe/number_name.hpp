#pragma once

#include <cstdint>
#include <string>

#include "base/short_text.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// The name of a number of a state for messages: its path of field names, and its field.
struct NumberName {
  std::string path;  // empty for a plain number
  const FieldRow* field = nullptr;
};
/// The name of the number at `offset` of a type.
NumberName name_at(const Schema& schema, std::uint32_t type, std::uint32_t offset);

/// Adds "velocity of actuator 'elbow'" for the n-th number of an actuator's state.
///
/// Realtime: yes.
template <std::size_t Size>
void name_number(const Schema& schema, std::uint32_t actuator, std::uint32_t number,
                 ShortText<Size>& text) noexcept {
  std::uint32_t place = 0;
  schema.each_scalar(schema.actuators[actuator].type, [&](std::uint32_t, const FieldRow& field) {
    if (place++ != number) return;
    if (!field.name.view().empty()) text.add(field.name.view()).add(" of ");
  });
  text.add("actuator '").add(schema.actuators[actuator].name.view()).add("'");
}

}  // namespace o80
