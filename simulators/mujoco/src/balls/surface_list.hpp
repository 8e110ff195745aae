#pragma once

#include <string>
#include <vector>

#include "balls/ball_options.hpp"
#include "balls/surface.hpp"

namespace o80::mujoco {

/// One entry of the option `surfaces`.
struct SurfaceEntry {
  std::string geom;
  Restitution restitution{1, 1, 1};
  double friction = kNoSliding;
  bool watched = false;
};

/// The surfaces that the options name, in their order. Throws DriverError.
std::vector<SurfaceEntry> surfaces_of(const BallOptions& options);

}  // namespace o80::mujoco
