#pragma once

#include <functional>
#include <memory>
#include <string>

#include "engine/pointers.hpp"

namespace o80::mujoco {

/// A compiled model that nobody changes.
using SharedModel = std::shared_ptr<const mjModel>;

/// What the copies of a simulation have in common.
struct MadeModel {
  SharedModel model;
  std::string mjcf;  // as text
};

/// What `make` returns; or what it returned for this key, if that is still in use in this process.
/// Copies of a simulation so need the memory of one model, most of which are its meshes and
/// textures, and the time to compile it once. May be called by several threads.
MadeModel shared(std::string key, const std::function<MadeModel()>& make);

/// The model with another step of the engine [s]: one for all that ask while it is in use.
SharedModel with_timestep(SharedModel model, double step);

}  // namespace o80::mujoco
