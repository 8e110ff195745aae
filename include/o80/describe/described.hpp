#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "o80/describe/for_each.hpp"
#include "o80/describe/schema.hpp"

/// Describes a struct: O80_DESCRIBE(Joint, (position, "[rad]"), (velocity, "[rad/s]",
/// o80::rests_at(0))), at namespace scope.
///
/// A text may hold a help and a unit in brackets. `rests_at(value)`: the field goes to that value
/// when no command drives its actuator. `of_the_clock()`, `of_the_world()`: a replay does not
/// compare the field. Every field must be named; a missing one does not compile.
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
  template <class O80Use>                                                                        \
  consteval bool o80_crosses_memory(::o80::Tag<Type>, O80Use) {                                  \
    using O80Type [[maybe_unused]] = Type;                                                       \
    O80_FOR_EACH(O80_CROSSES, Type, __VA_ARGS__)                                                 \
    return true;                                                                                 \
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
// depends on a template parameter: only structs that are shared are checked
#define O80_CROSSES(Type, field) O80_JOIN(O80_CROSSES_, O80_IS_GROUP(field))(Type, field)
#define O80_CROSSES_0(Type, field) O80_CROSSES_NAMED(Type, field)
#define O80_CROSSES_1(Type, field) O80_CROSSES_OF(Type, O80_FIRST field)
#define O80_CROSSES_OF(...) O80_CROSSES_NAMED(__VA_ARGS__)
#define O80_FIRST(first, ...) first
#define O80_CROSSES_NAMED(Type, field)                                                         \
  static_assert(::o80::describing::kCrossesMemory<decltype(O80Type::field), O80Use>,           \
                #Type "::" #field                                                              \
                      " cannot be shared between processes: use numbers, described enums, "    \
                      "described structs or a std::array of them (no pointer, std::string or " \
                      "std::vector)");
#define O80_LABEL(fixed, label) o80_visit(#label, O80Type::label);

namespace o80 {

/// Passes a type to the functions that O80_DESCRIBE defines (found by argument-dependent lookup).
template <class T>
struct Tag {};

/// Notes of O80_DESCRIBE about a field: a text, the rest value, and the origin.
struct FieldNote {
  std::string_view text;
  std::optional<RestsAt> rest;
  Origin origin = Origin::robot;

  constexpr FieldNote(std::string_view said) : text(said) {}  // NOLINT(google-explicit-constructor)
  constexpr FieldNote(const char* said) : text(said) {}       // NOLINT(google-explicit-constructor)
  /// Deleted: give unit and help in one text, "[m] height of the table".
  constexpr FieldNote(std::string_view unit, std::string_view help) = delete;
  constexpr FieldNote(std::string_view said, RestsAt where) : text(said), rest(where) {}
  constexpr FieldNote(RestsAt where) : rest(where) {}  // NOLINT(google-explicit-constructor)
  constexpr FieldNote(std::string_view said, Origin from) : text(said), origin(from) {}
  constexpr FieldNote(Origin from) : origin(from) {}  // NOLINT(google-explicit-constructor)
  constexpr bool empty() const { return text.empty() && !rest && origin == Origin::robot; }
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
struct ArrayOf : std::false_type {
  static constexpr std::size_t kCount = 1;
};
template <class T, std::size_t N>
struct ArrayOf<std::array<T, N>> : std::true_type {
  using Element = T;
  static constexpr std::size_t kCount = N;
};

}  // namespace describing

/// Number of fields of a plain struct (a std::array counts as one).
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

/// Types that can be the state of an actuator, the sensor values or the fields of a request.
template <class T>
concept Shareable =
    Number<T> || DescribedEnum<T> || (DescribedStruct<T> && std::is_trivially_copyable_v<T>);

namespace describing {

template <class T, class Use>
constexpr bool crosses_memory() {
  if constexpr (ArrayOf<T>::value) {
    return crosses_memory<typename ArrayOf<T>::Element, Use>();
  } else if constexpr (DescribedStruct<T>) {
    return o80_crosses_memory(Tag<T>{}, Use{}) && std::is_trivially_copyable_v<T>;
  } else {
    return Shareable<T>;
  }
}

/// True if a member of type `T` may be shared as part of a struct; `Use` is any type.
template <class T, class Use>
inline constexpr bool kCrossesMemory = crosses_memory<T, Use>();

}  // namespace describing

/// A state type with its own interpolation: `static T blend(const T&, const T&, double)`.
template <class T>
concept Blending = requires(const T& state, double share) {
  { T::blend(state, state, share) } -> std::same_as<T>;
};

}  // namespace o80
