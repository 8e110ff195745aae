#pragma once

#include <cstdint>
#include <string>

#include "balls/ball_options.hpp"
#include "o80/describe/describe.hpp"
#include "o80/describe/face.hpp"

namespace o80::mujoco {

/// Target of commands.
enum class JointMode : std::uint8_t {
  imposed,  // position and velocity of a joint, exactly
  control,  // the input of an actuator of the model
  actuated  // the input of a joint's actuator: position, velocity or torque
};
O80_DESCRIBE_ENUM(JointMode, imposed, control, actuated);

/// Options of a simulation. Names in a list are separated by commas.
struct Config {
  std::string model;
  std::string things;
  JointMode mode = JointMode::imposed;
  Face like;
  std::string joints;
  std::string limits;
  std::uint32_t steps = 0;
  double timestep = 0;
  std::string keyframe;
  std::uint32_t slots = 8;
  BallOptions ball_options;
};
O80_DESCRIBE(Config, (model, "MJCF file"),
             (things, "MJCF file of what stands around the model; empty: nothing"),
             (mode,
              "imposed: commands set joints exactly; control: inputs of actuators; actuated: what "
              "the actuators of joints take"),
             (like, "the robot whose face it takes: its name, a segment, a recording or a file"),
             (joints,
              "hinges and slides; empty: all; `elbow=j2` renames one, `jaw=j6 0 1` spreads 0 to 1 "
              "over its range"),
             (limits,
              "mode actuated: speed, acceleration, jerk, error of all joints or of one: "
              "`2 20 1000 0.3, elbow=1`"),
             (steps, "steps of the engine in an iteration; 0: as many as its period holds"),
             (timestep, "of the engine; 0: as the model says [s]"),
             (keyframe, "of the model, to start from; empty: none"), (slots, "for snapshots"),
             ball_options);

}  // namespace o80::mujoco
