#pragma once

#include "engine/pointers.hpp"

namespace o80::mujoco {

/// Removes geoms that are only drawn from `full` and `spec`, because the engine would compute
/// their places in every step. Such geoms have no name, no contacts, no mass, and no
/// drag. Returns `full` unchanged if it has sensors, some of which react to drawn geoms, or
/// plugins; if no geom is only drawn; and if bodies would change.
ModelPointer without_drawings(mjSpec& spec, ModelPointer full);

}  // namespace o80::mujoco
