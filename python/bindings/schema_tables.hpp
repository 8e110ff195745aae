#pragma once

#include "describe/visit_number.hpp"
#include "nb.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Names of origins in descriptions, in their order.
inline constexpr const char* kOriginNames[] = {"robot", "clock", "world", "absent"};

/// Description of a robot as dictionaries and lists; numbers without a limit are None.
nb::dict tables_of(const Schema& schema);

}  // namespace o80
