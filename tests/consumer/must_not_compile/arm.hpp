#pragma once

#include "o80/robot/make_table.hpp"

// What the drivers of this folder have in common: all but the mistake.

struct Joint {
  double position = 0.0;
};
O80_DESCRIBE(Joint, (position, "[rad]"));

struct Home {
  double speed = 1.0;
};
O80_DESCRIBE(Home, speed);

struct Force {
  double x = 0.0;
};
O80_DESCRIBE(Force, x);

/// Begins the class Arm.
#define ARM_WITHOUT_MISTAKE               \
 public:                                  \
  struct Config {};                       \
  using Actuators = std::array<Joint, 2>; \
  explicit Arm(const Config&) {}          \
  void start() {}                         \
  void write(const o80::Desired<Arm>&) {} \
  void read(o80::Reading<Arm>&) {}        \
  void stop() noexcept {}

/// Follows the class Arm.
#define ARM_AS_ROBOT         \
  O80_DESCRIBE(Arm::Config); \
  O80_ROBOT(arm, Arm)
