#pragma once

#include "nb.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Names of kinds in descriptions, in their order.
inline constexpr const char* kKindNames[] = {"bool",    "int8",   "int16",  "int32",  "int64",
                                             "uint8",   "uint16", "uint32", "uint64", "float32",
                                             "float64", "enum",   "struct", "text"};
/// Names of origins, likewise.
inline constexpr const char* kOriginNames[] = {"robot", "clock", "world", "absent"};

/// Description of a robot as dictionaries and lists; numbers without a limit are None.
nb::dict tables_of(const Schema& schema);

}  // namespace o80
