#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "o80/describe/for_each.hpp"
#include "o80/describe/schema.hpp"

/// Describes a struct: O80_DESCRIBE(Joint, (position, "[rad]"), (velocity, "[rad/s]",
/// o80::rests_at(0))), at namespace scope.
///
/// A text may hold a unit in brackets and a help. A field of an actuator's state that rests goes
/// there when no command drives it. Every field must be named: a forgotten one does not compile.
#define O80_DESCRIBE(Type, ...)                                                                  \
  static_assert(std::is_aggregate_v<Type>, #Type " must be a plain struct to be described");     \
  static_assert(::o80::field_count<Type>() == (0 O80_FOR_EACH(O80_PLUS_ONE, ~, __VA_ARGS__)),    \
                #Type ": describe every field, once (arrays as std::array, 64 fields at most)"); \
  [[maybe_unused]] constexpr std::string_view o80_type_name(::o80::Tag<Type>) { return #Type; }  \
  template <class O80Visit>                                                                      \
  constexpr void o80_describe(::o80::Tag<Type>, [[maybe_unused]] O80Visit&& o80_visit) {         \
    using O80Type [[maybe_unused]] = Type;                                                       \
    O80_FOR_EACH(O80_FIELD, ~, __VA_ARGS__)                                                      \
  }                                                                                              \
  static_assert(true)

/// Describes an enumeration: O80_DESCRIBE_ENUM(ControlMode, off, position, torque).
#define O80_DESCRIBE_ENUM(Type, ...)                                                            \
  [[maybe_unused]] constexpr std::string_view o80_type_name(::o80::Tag<Type>) { return #Type; } \
  template <class O80Visit>                                                                     \
  constexpr void o80_labels(::o80::Tag<Type>, O80Visit&& o80_visit) {                           \
    using O80Type = Type;                                                                       \
    O80_FOR_EACH(O80_LABEL, ~, __VA_ARGS__)                                                     \
  }                                                                                             \
  static_assert(true)

#define O80_PLUS_ONE(fixed, field) +1
#define O80_FIELD(fixed, field) O80_JOIN(O80_FIELD_, O80_IS_GROUP(field))(field)
#define O80_FIELD_0(field) O80_FIELD_NAMED(field, "")
#define O80_FIELD_1(field) O80_FIELD_NAMED field
#define O80_FIELD_NAMED(field, ...)                                         \
  o80_visit(#field, &O80Type::field, std::size_t{offsetof(O80Type, field)}, \
            ::o80::FieldNote(__VA_ARGS__));
#define O80_LABEL(fixed, label) o80_visit(#label, O80Type::label);

namespace o80 {

/// Carries a type to the functions that O80_DESCRIBE makes, which are found by its namespace.
template <class T>
struct Tag {};

/// What O80_DESCRIBE says about a field: a text, and where it rests.
struct FieldNote {
  std::string_view text;
  std::optional<RestsAt> rest;

  constexpr FieldNote(std::string_view said) : text(said) {}  // NOLINT(google-explicit-constructor)
  constexpr FieldNote(const char* said) : text(said) {}       // NOLINT(google-explicit-constructor)
  constexpr FieldNote(std::string_view said, RestsAt where) : text(said), rest(where) {}
  constexpr FieldNote(RestsAt where) : rest(where) {}  // NOLINT(google-explicit-constructor)
  // NOLINTNEXTLINE(google-explicit-constructor)
  constexpr operator std::string_view() const { return text; }
};

namespace describing {

struct Anything {
  template <class T>
  operator T() const;  // NOLINT(google-explicit-constructor)
};

template <class T, std::size_t... I>
constexpr bool takes(std::index_sequence<I...>) {
  return requires { T{(static_cast<void>(I), Anything{})...}; };
}

template <class T>
struct ArrayOf : std::false_type {};
template <class T, std::size_t N>
struct ArrayOf<std::array<T, N>> : std::true_type {
  using Element = T;
  static constexpr std::size_t kCount = N;
};

}  // namespace describing

/// How many fields a plain struct has (arrays are std::array, which counts as one).
template <class T, std::size_t N = 64>
consteval std::size_t field_count() {
  if constexpr (N == 0 || describing::takes<T>(std::make_index_sequence<N>{})) {
    return N;
  } else {
    return field_count<T, N - 1>();
  }
}

template <class T>
concept DescribedStruct = requires(void (*visit)(...)) {
  o80_type_name(Tag<T>{});
  o80_describe(Tag<T>{}, [](auto&&...) {});
};
template <class T>
concept DescribedEnum = std::is_enum_v<T> && requires { o80_labels(Tag<T>{}, [](auto&&...) {}); };
template <class T>
concept Number = std::is_arithmetic_v<T> && !std::is_same_v<T, char> &&
                 !std::is_same_v<T, wchar_t> && !std::is_same_v<T, long double>;

/// What may be the state of an actuator, sensor values or the body of a request.
template <class T>
concept Shareable =
    Number<T> || DescribedEnum<T> || (DescribedStruct<T> && std::is_trivially_copyable_v<T>);

/// A state type with its own way to interpolate: `static T blend(const T&, const T&, double)`.
template <class T>
concept Blending = requires(const T& state, double share) {
  { T::blend(state, state, share) } -> std::same_as<T>;
};

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
inline constexpr char kKey = 0;  // its address tells types apart

template <Shareable T>
std::uint32_t type_of(Schema& schema);

/// The row of one field of type T (arrays taken apart); nested types are added first.
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

template <Shareable T>
std::uint32_t type_of(Schema& schema) {
  for (std::uint32_t i = 0; i < schema.keys.size(); ++i) {
    if (schema.keys[i] == &kKey<T>) return i;
  }
  std::vector<FieldRow> members;
  std::string_view name;
  if constexpr (DescribedStruct<T>) {
    name = o80_type_name(Tag<T>{});
    o80_describe(Tag<T>{}, [&]<class Field>(std::string_view field, Field T::*, std::size_t offset,
                                            const FieldNote& note) {
      members.push_back(field_row<Field>(schema, field, offset, note.text));
      members.back().resting = note.rest ? 1 : 0;
      if (note.rest) members.back().rest = note.rest->value;
    });
  } else {
    members.push_back(field_row<T>(schema, "", 0, ""));
  }
  TypeRow row;
  const auto colon = name.rfind(':');
  row.name = NameText(colon == std::string_view::npos ? name : name.substr(colon + 1));
  row.size = sizeof(T);
  row.alignment = alignof(T);
  row.first_field = static_cast<std::uint32_t>(schema.fields.size());
  row.fields = static_cast<std::uint32_t>(members.size());
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
  schema.keys.push_back(&kKey<T>);
  return static_cast<std::uint32_t>(schema.types.size() - 1);
}

/// Bytes of T that are numbers; less than sizeof(T) if there is padding.
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

/// Copies a value without its padding: those bytes of `out` stay as they are (zero in a row).
/// A struct without fields has nothing to copy, and `out` may be null.
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

/// A robot without actuators: a pure sensor.
struct NoActuators {};
/// No sensor values beside the states.
struct NoExtended {};

/// Adds the actuators of a std::array of states, or of a described struct (each field an actuator,
/// an array field many).
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
    o80_describe(Tag<Actuators>{}, [&]<class Field>(std::string_view name, Field Actuators::*,
                                                    std::size_t offset, std::string_view) {
      const auto place = static_cast<std::uint32_t>(offset);
      if constexpr (describing::ArrayOf<Field>::value) {
        using StateType = typename describing::ArrayOf<Field>::Element;
        schema.place_group(name, describing::type_of<StateType>(schema), place,
                           describing::ArrayOf<Field>::kCount, true);
      } else {
        schema.place_group(name, describing::type_of<Field>(schema), place, 1, false);
      }
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
