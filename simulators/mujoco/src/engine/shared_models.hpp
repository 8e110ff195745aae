#pragma once

#include <functional>
#include <memory>
#include <string>

#include "engine/pointers.hpp"

namespace o80::mujoco {

/// Compiled, constant model.
using SharedModel = std::shared_ptr<const mjModel>;

/// Common data of a simulation's copies.
struct MadeModel {
  SharedModel model;
  std::string mjcf;  // as text
};

/// Returns the result of `make`, or its earlier result for this key if still in use in this
/// process. Copies of a simulation therefore need the memory of one model, mostly meshes and
/// textures, and one compilation. May be called by several threads.
MadeModel shared(std::string key, const std::function<MadeModel()>& make);

/// Returns the model with another time step [s], shared by all users.
SharedModel with_timestep(SharedModel model, double step);

}  // namespace o80::mujoco
