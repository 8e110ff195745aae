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

// The verbs, unless one of them is the mistake.
#ifndef ARM_START
#define ARM_START \
  void start() {}
#endif
#ifndef ARM_WRITE
#define ARM_WRITE \
  void write(const o80::Desired<Arm>&) {}
#endif
#ifndef ARM_READ
#define ARM_READ \
  void read(o80::Reading<Arm>&) {}
#endif
#ifndef ARM_STOP
#define ARM_STOP \
  void stop() noexcept {}
#endif

#ifndef ARM_STATE
#define ARM_STATE Joint
#endif

/// Begins the class Arm.
#define ARM_WITHOUT_MISTAKE                   \
 public:                                      \
  struct Config {};                           \
  using Actuators = std::array<ARM_STATE, 2>; \
  explicit Arm(const Config&) {}              \
  ARM_START                                   \
  ARM_WRITE                                   \
  ARM_READ                                    \
  ARM_STOP

/// Follows the class Arm.
#define ARM_AS_ROBOT         \
  O80_DESCRIBE(Arm::Config); \
  O80_ROBOT(arm, Arm)
