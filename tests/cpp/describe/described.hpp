#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "message_of.hpp"
#include "o80/describe/describe.hpp"
#include "o80/describe/options.hpp"
#include "o80/runtime/robot_types.hpp"

/// Structs of every shape that can be described.
namespace described {

enum class ControlMode : std::uint8_t { off, position = 3, torque };
O80_DESCRIBE_ENUM(ControlMode, off, position, torque);

struct Joint {
  double position = 0, velocity = 0;
};
O80_DESCRIBE(Joint, (position, "[rad]"), (velocity, "how fast [rad/s]"));

/// Fields that a replay compares, and that it does not.
struct Origins {
  double force = 0;
  std::int64_t stamp = 0;
  float camera = 0;
};
O80_DESCRIBE(Origins, force, (stamp, "[ns]", o80::of_the_clock()), (camera, o80::of_the_world()));

struct Gripper {
  float width = 0;
  bool closed = false;
};
O80_DESCRIBE(Gripper, (width, "between the fingers [m]"), closed);

/// Padded in three places.
struct Padded {
  std::uint8_t small = 0;
  double large = 0;
  std::int16_t middle = 0;
};
O80_DESCRIBE(Padded, small, large, middle);

struct Sensors {
  std::array<double, 3> force{};
  std::array<std::array<float, 2>, 4> matrix{};
  Joint nested{};
  std::array<Padded, 2> padded{};
  ControlMode mode = ControlMode::off;
  std::int64_t count = 0;
};
O80_DESCRIBE(Sensors, (force, "at the tool [N]"), matrix, nested, padded, mode, count);

struct Actuators {
  std::array<Joint, 7> joints{};
  Gripper gripper{};
  ControlMode mode = ControlMode::off;
};
O80_DESCRIBE(Actuators, joints, gripper, mode);

struct Home {};
O80_DESCRIBE(Home);
struct LaunchBall {
  double speed = 0;
  ControlMode mode = ControlMode::off;
};
O80_DESCRIBE(LaunchBall, (speed, "[m/s]"), mode);

/// Seven joints, a gripper and a mode.
struct MixedRobot {
  using Actuators = described::Actuators;
  using Extended = Sensors;
  using Requests = o80::Requests<Home, LaunchBall>;
};

struct Config {
  std::string address = "192.168.0.1";
  double gain = 1.5;
  int count = -3;
  bool fast = true;
  ControlMode mode = ControlMode::position;
  std::array<double, 3> offsets{0.5, -1, 1e-300};
  std::uint8_t small = 200;
};
O80_DESCRIBE(Config, (address, "where the arm listens"), (gain, "of the loop [Nm/rad]"), count,
             fast, mode, offsets, small);

/// The options of a part of a robot, in a struct of their own.
struct GripperConfig {
  double grip = 0.5;
  std::array<double, 2> fingers{1, 2};
};
O80_DESCRIBE(GripperConfig, (grip, "how hard [N]"), fingers);

struct ConfigOfParts {
  std::string address = "192.168.0.1";
  GripperConfig gripper;
  int count = -3;
};
O80_DESCRIBE(ConfigOfParts, (address, "where the arm listens"), gripper, count);

template <class Robot>
o80::Schema schema_of() {
  o80::Schema schema;
  schema.head.robot = o80::NameText("mixed");
  schema.head.period = 1'000'000;
  o80::describe_types<Robot>(schema);
  return schema;
}

}  // namespace described
