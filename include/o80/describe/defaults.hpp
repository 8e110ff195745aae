#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "o80/describe/described.hpp"

// Finds, at compile time, the fields of a described struct that have a default. It reads each field
// of an object without an initialiser: a field without a default member initialiser has no value,
// so reading it is not a constant expression.

namespace o80::describing {

template <class T>
constexpr bool read_numbers(const T& value) {
  bool all = true;
  if constexpr (ArrayOf<T>::value) {
    for (const auto& element : value) all = all && read_numbers(element);
  } else if constexpr (DescribedStruct<T>) {
    o80_describe(Tag<T>{}, [&](auto&&, auto T::* member, auto&&...) {
      all = all && read_numbers(value.*member);
    });
  } else {
    // a read that is no constant expression means: no default
    // NOLINTNEXTLINE(clang-analyzer-core.uninitialized.Assign)
    [[maybe_unused]] const T read = value;
  }
  return all;
}

template <class T, std::size_t I>
constexpr bool read_field() {
  T value;
  std::size_t i = 0;
  bool all = true;
  o80_describe(Tag<T>{}, [&](auto&&, auto T::* member, auto&&...) {
    if (i++ == I) all = read_numbers(value.*member);
  });
  return all;
}

/// True if each number of field I has a constant default member initialiser.
template <class T, std::size_t I>
concept HasDefault = requires { typename std::bool_constant<read_field<T, I>()>; };

template <class T, std::size_t... I>
consteval auto defaults_of(std::index_sequence<I...>) {
  return std::array<bool, sizeof...(I)>{HasDefault<T, I>...};
}

}  // namespace o80::describing
