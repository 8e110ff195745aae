#pragma once

#include "engine/pointers.hpp"

namespace o80::mujoco {

/// `full`, compiled from `spec`, without the geoms that are only drawn: the engine would compute
/// where each of them is, in every step. They have no name, touch nothing, weigh nothing, and feel
/// no air; the spec loses them. `full` itself where it has sensors, some of which see what is
/// drawn, or plugins; where nothing is only drawn; and where bodies would not be the same.
ModelPointer without_drawings(mjSpec& spec, ModelPointer full);

}  // namespace o80::mujoco
