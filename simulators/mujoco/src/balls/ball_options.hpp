#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "o80/describe/describe.hpp"

namespace o80::mujoco {

/// Options of the balls of a simulation. Names in a list are separated by commas.
struct BallOptions {
  std::string balls;
  std::uint32_t extra_balls = 0;
  std::string surfaces;
  std::string watched;
  std::array<double, 3> restitution{1.0, 1.0, 0.8};
  double air_density = 1.2;
  double drag_coefficient = 0.47;
  double lift_coefficient = 1.0;
  double lift_saturation = 0.0;
  double spin_decay = 0.0;
  std::array<double, 3> spin{};
  double teleport_distance = 0.1;
};
O80_DESCRIBE(
    BallOptions, (balls, "free bodies with one sphere: imposed while commanded, else they fly"),
    (extra_balls, "copies of the first ball to add, named <ball>_1, <ball>_2, ..."),
    (surfaces,
     "geoms that balls bounce on: `floor`, or with restitution (3 numbers) and friction "
     "`floor=0.7 0.7 0.75 0.25`"),
    (watched,
     "surfaces that end the commands of a ball and whose first contact is recorded in full"),
    (restitution, "shares of the velocity that a ball without spin keeps: two tangents, normal"),
    (air_density, "[kg/m^3]"), (drag_coefficient, "of a ball"),
    (lift_coefficient, "of a spinning ball, per radius x spin / speed"),
    (lift_saturation, "the lift is divided by 1 + this x radius x spin / speed"),
    (spin_decay, "share of the spin lost in a second [1/s]"),
    (spin, "of the balls at the start [rad/s]"),
    (teleport_distance, "a body farther than this from its predicted position was teleported [m]"));

}  // namespace o80::mujoco
