#pragma once

#include <nanobind/nanobind.h>

#include "o80/describe/schema.hpp"

namespace o80 {

/// Description of a robot as dictionaries and lists; numbers without a limit are None.
nanobind::dict tables_of(const Schema& schema);

}  // namespace o80
