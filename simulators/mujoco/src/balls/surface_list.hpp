#pragma once

#include <string>
#include <vector>

#include "balls/ball_options.hpp"
#include "balls/surface.hpp"

namespace o80::mujoco {

/// Entry of the option `surfaces`.
struct SurfaceEntry {
  std::string geom;
  Restitution restitution{1, 1, 1};
  double friction = kNoSliding;
  bool watched = false;
};

/// Parses the surfaces named by the options, in order. Throws DriverError.
std::vector<SurfaceEntry> surfaces_of(const BallOptions& options);

}  // namespace o80::mujoco
