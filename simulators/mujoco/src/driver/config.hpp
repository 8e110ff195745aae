#pragma once

#include <cstdint>
#include <string>

#include "balls/ball_options.hpp"
#include "o80/describe/describe.hpp"

namespace o80::mujoco {

/// What a command to the robot sets.
enum class JointMode : std::uint8_t {
  imposed,  // position and velocity of a joint, exactly
  control   // the input of an actuator of the model
};
O80_DESCRIBE_ENUM(JointMode, imposed, control);

/// Options of a simulation. Names in a list are separated by commas.
struct Config {
  std::string model;
  JointMode mode = JointMode::imposed;
  std::string joints;
  std::uint32_t steps = 0;
  double timestep = 0;
  std::string keyframe;
  std::uint32_t slots = 8;
  BallOptions ball_options;
};
O80_DESCRIBE(Config, (model, "MJCF file"),
             (mode,
              "imposed: commands set joints exactly; control: they drive the model's actuators"),
             (joints, "hinges and slides to impose, or to publish in mode control; empty: all"),
             (steps, "steps of the engine in an iteration; 0: as many as its period holds"),
             (timestep, "of the engine; 0: as the model says [s]"),
             (keyframe, "of the model, to start from; empty: none"), (slots, "for snapshots"),
             ball_options);

}  // namespace o80::mujoco
