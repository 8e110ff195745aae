#pragma once

#include <memory>

#include "engine/pointers.hpp"

namespace o80::mujoco {

/// A compiled model that nobody changes.
using SharedModel = std::shared_ptr<const mjModel>;

/// The same model; if an equal one (byte by byte) is in use in this process, that one, and `model`
/// is deleted. Copies of a simulation so need the memory of one model, most of which are its
/// textures. May be called by several threads.
SharedModel shared(ModelPointer model);

}  // namespace o80::mujoco
