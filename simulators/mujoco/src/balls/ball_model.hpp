#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>
#include <string>
#include <vector>

#include "balls/ball_options.hpp"
#include "balls/bounce.hpp"

// The balls and surfaces of a MuJoCo model.

namespace o80::mujoco {

/// A free body that is a ball.
struct BallPlace {
  std::string name;
  int position;  // in qpos
  int velocity;  // in qvel
  Sphere sphere;
  double mass;  // [kg]
};

/// A geom that balls bounce on.
struct SurfacePlace {
  std::string name;
  int geom;
  bool still;  // part of the world
  Shape shape;
  Restitution restitution;
  double friction;
  bool watched;
};

inline constexpr std::uint32_t kMaxExtraBalls = 1000;

/// True if the options name balls. Throws DriverError if they name surfaces only, or if a number is
/// out of its range.
bool has_balls(const BallOptions& options);

/// Adds copies of the first ball to a model that is not compiled yet. Throws DriverError.
void add_extra_balls(mjSpec& spec, const BallOptions& options);

/// Switches the contacts of the balls in the engine off: `Balls` computes them. Throws DriverError.
void switch_off_contacts(mjModel& model, const BallOptions& options);

/// The balls that the options name. Throws DriverError.
std::vector<BallPlace> balls_in(const mjModel& model, const BallOptions& options);

/// The surfaces that the options name, in their order. Throws DriverError.
std::vector<SurfacePlace> surfaces_in(const mjModel& model, const BallOptions& options);

}  // namespace o80::mujoco
