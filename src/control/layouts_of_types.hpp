#pragma once

#include <optional>
#include <vector>

#include "control/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// The layouts of the types of a schema that actuators and requests use, by the index of the type.
/// Throws InvalidArgument if an actuator cannot be controlled as it is described.
std::vector<std::optional<StateLayout>> layouts_of_types(const Schema& schema);

}  // namespace o80
