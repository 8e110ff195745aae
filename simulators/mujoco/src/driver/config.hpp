#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "o80/describe/describe.hpp"

namespace o80::mujoco {

/// What a command to a joint does.
enum class JointMode : std::uint8_t {
  imposed,  // the joint is where it is asked to be, and as fast
  control   // the model's actuators get the number that is asked for
};
O80_DESCRIBE_ENUM(JointMode, imposed, control);

/// What a simulation is started with. Several names are parted by commas.
struct Config {
  std::string model;
  std::string joints;
  JointMode mode = JointMode::imposed;
  std::string balls;
  std::uint32_t extra_balls = 0;
  std::uint32_t steps = 0;
  double timestep = 0;
  std::string keyframe;
  std::uint32_t slots = 8;

  std::string racket;
  std::string table;
  std::string net;
  std::string floor;
  std::array<double, 3> racket_restitution{0.78, 0.78, 0.78};
  std::array<double, 3> table_restitution{0.70, 0.70, 0.92};
  std::array<double, 3> net_restitution{0.50, 0.50, 0.15};
  std::array<double, 3> floor_restitution{0.70, 0.70, 0.75};
  double air_density = 1.18;
  double drag_coefficient = 0.40;
  double lift_coefficient = 1.47;
  double spin_decay = 0.5;
  std::array<double, 3> spin{30.0, 0.0, 0.0};
  double jump = 0.1;
};
O80_DESCRIBE(Config, (model, "MJCF file"),
             (joints, "hinges and slides to command (control: to report); empty: all of them"),
             (mode,
              "imposed: joints are put where they are asked to be; control: the model's actuators"),
             (balls, "free bodies: imposed while commanded, else in free flight"),
             (extra_balls, "copies of the first ball to add, named <ball>_1 and on"),
             (steps, "of the simulator in an iteration; 0: as many as its period holds"),
             (timestep, "of the simulator; 0: as the model says [s]"),
             (keyframe, "of the model to start from; empty: none"), (slots, "for snapshots"),
             (racket, "geom (ellipsoid: an elliptic blade) that balls bounce on; empty: none"),
             (table, "geom (box or plane) that balls bounce on; empty: none"),
             (net, "geom (box or plane) that balls bounce on; empty: none"),
             (floor, "geom (box or plane) that balls bounce on; empty: none"),
             (racket_restitution, "share of the velocity kept: two tangents, normal"),
             (table_restitution, "share of the velocity kept: two tangents, normal"),
             (net_restitution, "share of the velocity kept: two tangents, normal"),
             (floor_restitution, "share of the velocity kept: two tangents, normal"),
             (air_density, "[kg/m^3]"), (drag_coefficient, "of a ball"),
             (lift_coefficient, "of a spinning ball"),
             (spin_decay, "share of the spin lost a second [1/s]"),
             (spin, "of a ball when its free flight begins [rad/s]"),
             (jump, "farther from where its velocity leads, a body was put there, not moved [m]"));

}  // namespace o80::mujoco
