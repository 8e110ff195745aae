#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>
#include <string>
#include <vector>

#include "balls/ball_options.hpp"
#include "balls/bounce.hpp"

// The balls and surfaces of a MuJoCo model.

namespace o80::mujoco {

/// Free body that is a ball.
struct BallPlace {
  std::string name;
  int position;  // in qpos
  int velocity;  // in qvel
  Sphere sphere;
  double mass;  // [kg]
};

/// Geom on which balls bounce.
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

/// True if the options name balls. Throws DriverError if they name surfaces only, or for a number
/// out of range.
bool has_balls(const BallOptions& options);

/// Adds copies of the first ball to an uncompiled model. Throws DriverError.
void add_extra_balls(mjSpec& spec, const BallOptions& options);

/// Switches the engine's contacts of balls off: `Balls` computes them. Throws DriverError.
void switch_off_contacts(mjModel& model, const BallOptions& options);

/// Finds the balls named by the options. Throws DriverError.
std::vector<BallPlace> balls_in(const mjModel& model, const BallOptions& options);

/// Finds the surfaces named by the options, in order. Throws DriverError.
std::vector<SurfacePlace> surfaces_in(const mjModel& model, const BallOptions& options);

}  // namespace o80::mujoco
