#pragma once

#include <array>
#include <cstdint>

#include "o80/describe/describe.hpp"
#include "o80/describe/schema.hpp"
#include "o80/robot/plant_requests.hpp"
#include "o80/runtime/robot_types.hpp"

namespace o80::fuzz {

enum class Gear : std::uint8_t { off, low, high = 7 };
O80_DESCRIBE_ENUM(Gear, off, low, high);

struct Hand {
  float width = 0;
  std::array<std::int16_t, 2> fingers{};
  bool closed = false;
  Gear gear = Gear::off;
};
O80_DESCRIBE(Hand, (width, "between the fingers [m]"), fingers, closed, gear);

struct Sensors {
  std::array<std::array<double, 2>, 2> force{};
  Hand felt{};
};
O80_DESCRIBE(Sensors, (force, "at the tool [N]"), felt);

/// Two limited joints and a hand of mixed numbers: something of every kind.
struct Robot {
  struct Actuators {
    std::array<double, 2> joints{};
    Hand hand{};
  };
  using Extended = Sensors;
  using Requests = o80::Requests<Reset, Snapshot, Restore>;
};
O80_DESCRIBE(Robot::Actuators, joints, hand);

inline constexpr double kReach = 1.0;    // [rad] either way
inline constexpr double kSpeed = 500.0;  // [rad/s]

inline Schema schema_of_robot() {
  Schema schema;
  schema.head.robot = NameText("robot");
  describe_types<Robot>(schema);
  for (std::uint32_t i = 0; i < 2; ++i) {
    schema.actuator(i).limits({.minimum = -kReach, .maximum = kReach, .speed = kSpeed});
  }
  return schema;
}

}  // namespace o80::fuzz
