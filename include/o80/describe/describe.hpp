#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "o80/describe/defaults.hpp"
#include "o80/describe/described.hpp"
#include "o80/describe/schema.hpp"

// Turns described structs into entries of a schema, and their values into bytes.

namespace o80 {

namespace describing {

template <Number T>
constexpr Kind kind_of() {
  if constexpr (std::is_same_v<T, bool>) {
    return Kind::boolean;
  } else if constexpr (std::is_floating_point_v<T>) {
    return sizeof(T) == 4 ? Kind::float32 : Kind::float64;
  } else {
    constexpr int kWidth = sizeof(T) == 1 ? 0 : sizeof(T) == 2 ? 1 : sizeof(T) == 4 ? 2 : 3;
    return static_cast<Kind>(static_cast<int>(std::is_signed_v<T> ? Kind::int8 : Kind::uint8) +
                             kWidth);
  }
}

template <class T>
void add_defaults(Schema& schema, TypeRow& row, std::vector<FieldRow>& members);

template <class T>
inline constexpr char kKey = 0;  // has a unique address for each type

template <Shareable T>
std::uint32_t type_of(Schema& schema, const FieldNote& note = "");

/// The entry of one field of type T; an array becomes its element and a shape. Nested types are
/// added first.
template <class T>
FieldRow field_row(Schema& schema, std::string_view name, std::size_t offset,
                   std::string_view text) {
  FieldRow row;
  if constexpr (ArrayOf<T>::value) {
    using Element = typename ArrayOf<T>::Element;
    row = field_row<Element>(schema, name, offset, text);
    if (row.columns != 0) {
      throw InvalidArgument("field '" + std::string(name) +
                            "': an array has two dimensions at most");
    }
    row.columns = row.rows;
    row.rows = static_cast<std::uint32_t>(ArrayOf<T>::kCount);
    return row;
  } else {
    row.name = NameText(name);
    set_text(row, text);
    row.offset = static_cast<std::uint32_t>(offset);
    row.size = sizeof(T);
    if constexpr (DescribedEnum<T>) {
      row.kind = Kind::enumeration;
      row.is_signed = std::is_signed_v<std::underlying_type_t<T>> ? 1 : 0;
      row.first_label = static_cast<std::uint32_t>(schema.labels.size());
      o80_labels(Tag<T>{}, [&](std::string_view label, T value) {
        schema.labels.push_back({NameText(label), static_cast<std::int64_t>(value)});
        ++row.labels;
      });
    } else if constexpr (Number<T>) {
      row.kind = kind_of<T>();
    } else {
      static_assert(
          Shareable<T>,
          "a field must be a number, a described enum or struct, or a std::array of them");
      row.kind = Kind::structure;
      row.type = type_of<T>(schema);
    }
    return row;
  }
}

/// Index of the type T. `note`: of a plain number, which then becomes a separate type.
template <Shareable T>
std::uint32_t type_of(Schema& schema, const FieldNote& note) {
  for (std::uint32_t i = 0; i < schema.keys.size(); ++i) {
    if (note.empty() && schema.keys[i] == &kKey<T>) return i;
  }
  std::vector<FieldRow> members;
  std::string_view name;
  const auto add = [&]<class Field>(std::string_view field, Field*, std::size_t offset,
                                    const FieldNote& said) {
    members.push_back(field_row<Field>(schema, field, offset, said.text));
    members.back().resting = said.rest ? 1 : 0;
    if (said.rest) members.back().rest = said.rest->value;
    members.back().origin = said.origin;
  };
  if constexpr (DescribedStruct<T>) {
    name = o80_type_name(Tag<T>{});
    o80_describe(Tag<T>{}, [&]<class Field>(std::string_view field, Field T::*, std::size_t offset,
                                            const FieldNote& said) {
      add(field, static_cast<Field*>(nullptr), offset, said);
    });
  } else {
    add("", static_cast<T*>(nullptr), 0, note);
  }
  TypeRow row;
  const auto colon = name.rfind(':');
  row.name = NameText(colon == std::string_view::npos ? name : name.substr(colon + 1));
  row.size = sizeof(T);
  row.alignment = alignof(T);
  row.first_field = static_cast<std::uint32_t>(schema.fields.size());
  row.fields = static_cast<std::uint32_t>(members.size());
  row.blends = Blending<T> ? 1 : 0;
  if constexpr (DescribedStruct<T>) add_defaults<T>(schema, row, members);
  schema.fields.insert(schema.fields.end(), members.begin(), members.end());
  schema.types.push_back(row);
  TypeHooks hooks;
  if constexpr (Blending<T>) {
    hooks.blend = [](void* out, const void* from, const void* to, double share) {
      T a;
      T b;
      std::memcpy(&a, from, sizeof(T));
      std::memcpy(&b, to, sizeof(T));
      const T blended = T::blend(a, b, share);
      std::memcpy(out, &blended, sizeof(T));
    };
  }
  schema.hooks.push_back(hooks);
  schema.keys.push_back(note.empty() ? &kKey<T> : nullptr);
  return static_cast<std::uint32_t>(schema.types.size() - 1);
}

/// Size of T without padding [bytes].
template <class T>
constexpr std::size_t payload() {
  if constexpr (ArrayOf<T>::value) {
    return ArrayOf<T>::kCount * payload<typename ArrayOf<T>::Element>();
  } else if constexpr (DescribedStruct<T>) {
    std::size_t sum = 0;
    o80_describe(Tag<T>{}, [&]<class Field>(std::string_view, Field T::*, std::size_t,
                                            std::string_view) { sum += payload<Field>(); });
    return sum;
  } else {
    return sizeof(T);
  }
}

}  // namespace describing

/// Copies a value without its padding: padding bytes of `out` keep their value (zero in a row).
/// For a struct without fields `out` may be null.
template <class T>
void pack(const T& value, std::byte* out) {
  if constexpr (std::is_empty_v<T>) {
    return;
  } else if constexpr (describing::payload<T>() == sizeof(T)) {
    std::memcpy(out, &value, sizeof(T));
  } else if constexpr (describing::ArrayOf<T>::value) {
    for (const auto& element : value) {
      pack(element, out);
      out += sizeof(element);
    }
  } else {
    o80_describe(Tag<T>{},
                 [&]<class Field>(std::string_view, Field T::* member, std::size_t offset,
                                  std::string_view) { pack(value.*member, out + offset); });
  }
}

template <class T>
T unpack(const std::byte* from) {
  static_assert(std::is_trivially_copyable_v<T>);
  T value{};
  if constexpr (!std::is_empty_v<T>) std::memcpy(&value, from, sizeof(T));
  return value;
}

namespace describing {

/// Marks the fields that have a default, and stores their values.
template <class T>
void add_defaults(Schema& schema, TypeRow& row, std::vector<FieldRow>& members) {
  constexpr auto kHasDefault = defaults_of<T>(std::make_index_sequence<field_count<T>()>());
  bool any = false;
  for (std::size_t i = 0; i < members.size(); ++i) {
    members[i].has_default = kHasDefault[i] ? 1 : 0;
    any = any || kHasDefault[i];
  }
  if (!any) return;
  row.first_default = static_cast<std::uint32_t>(schema.defaults.size());
  schema.defaults.resize(schema.defaults.size() + sizeof(T));
  pack(T{}, schema.defaults.data() + row.first_default);
}

}  // namespace describing

/// The Actuators type of a robot without actuators (a pure sensor).
struct NoActuators {};
/// The Extended type of a robot without sensor values beside its states.
struct NoExtended {};

namespace describing {

template <class T>
struct StateOf {
  using Type = T;
};
template <class T, std::size_t N>
struct StateOf<std::array<T, N>> {
  using Type = T;
};

/// False if a field of struct type has a note: units belong to numbers.
template <class Actuators>
consteval bool notes_are_of_numbers() {
  bool are = true;
  o80_describe(Tag<Actuators>{}, [&]<class Field>(std::string_view, Field Actuators::*, std::size_t,
                                                  const FieldNote& note) {
    are = are && (note.empty() || !DescribedStruct<typename StateOf<Field>::Type>);
  });
  return are;
}

}  // namespace describing

/// Adds the actuators of a std::array of states, or of a described struct: one actuator for each
/// field, and one for each element of an array field.
template <class Actuators>
void describe_actuators(Schema& schema) {
  if constexpr (std::is_same_v<Actuators, NoActuators>) {
    return;
  } else if constexpr (describing::ArrayOf<Actuators>::value) {
    using StateType = typename describing::ArrayOf<Actuators>::Element;
    schema.place_group("", describing::type_of<StateType>(schema), 0,
                       describing::ArrayOf<Actuators>::kCount, true);
    schema.head.block = round_up(sizeof(Actuators), 8);
  } else {
    static_assert(DescribedStruct<Actuators>,
                  "Actuators is a std::array of states or a described struct of them");
    static_assert(describing::notes_are_of_numbers<Actuators>(),
                  "an actuator whose state is a struct takes no unit or other note here: write it "
                  "at the fields of that struct");
    o80_describe(Tag<Actuators>{}, [&]<class Field>(std::string_view name, Field Actuators::*,
                                                    std::size_t offset, const FieldNote& note) {
      using StateType = typename describing::StateOf<Field>::Type;
      schema.place_group(name, describing::type_of<StateType>(schema, note),
                         static_cast<std::uint32_t>(offset), describing::ArrayOf<Field>::kCount,
                         describing::ArrayOf<Field>::value);
    });
    schema.head.block = round_up(sizeof(Actuators), 8);
  }
}

template <class Extended>
void describe_extended(Schema& schema) {
  if constexpr (!std::is_same_v<Extended, NoExtended>) {
    schema.head.extended = describing::type_of<Extended>(schema);
  }
}

}  // namespace o80
