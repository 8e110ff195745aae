#pragma once

#include <optional>
#include <vector>

#include "control/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// The layout of each type that an actuator or a request uses, by index of the type; others are
/// empty. Throws InvalidArgument if an actuator cannot be controlled.
std::vector<std::optional<StateLayout>> layouts_of_types(const Schema& schema);

}  // namespace o80
