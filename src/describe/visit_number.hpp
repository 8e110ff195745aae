#pragma once

#include <cstdint>

#include "o80/describe/schema.hpp"

namespace o80 {

/// Names of kinds in descriptions, in their order.
inline constexpr const char* kKindNames[] = {"bool",    "int8",   "int16",  "int32",  "int64",
                                             "uint8",   "uint16", "uint32", "uint64", "float32",
                                             "float64", "enum",   "struct", "text"};

/// Calls `visit(T{})` with the C++ type of a number of this kind. Kinds without such a type
/// (boolean, enumeration, structure) are passed as a byte.
template <class Visit>
constexpr decltype(auto) visit_number(Kind kind, Visit&& visit) {
  switch (kind) {
    case Kind::float64:
      return visit(double{});
    case Kind::float32:
      return visit(float{});
    case Kind::int8:
      return visit(std::int8_t{});
    case Kind::int16:
      return visit(std::int16_t{});
    case Kind::int32:
      return visit(std::int32_t{});
    case Kind::int64:
      return visit(std::int64_t{});
    case Kind::uint16:
      return visit(std::uint16_t{});
    case Kind::uint32:
      return visit(std::uint32_t{});
    case Kind::uint64:
      return visit(std::uint64_t{});
    default:
      return visit(std::uint8_t{});
  }
}

}  // namespace o80
