#pragma once

#include <mujoco/mujoco.h>

#include <cstdint>
#include <limits>
#include <vector>

namespace o80::mujoco {

/// Number of a joint: input of an actuator of the model, or reading.
enum class Quantity : std::uint8_t { position, velocity, effort, none };

/// Linear conversion: factor x number + shift.
struct Line {
  double factor = 1;
  double shift = 0;
  double of(double number) const noexcept { return factor * number + shift; }
  double back(double number) const noexcept { return (number - shift) / factor; }
};

struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
};

Range intersection(const Range& a, const Range& b);

/// Actuator of the model that drives a hinge or a slide.
struct Servo {
  int actuator, joint;  // ids
  int control;          // address in ctrl
  Quantity commanded;   // of the joint
  Line input;           // from that number, in [rad], [m], ... of the joint, to ctrl
  Range allowed;    // range of the number, by ctrlrange; of a position also by the joint's range
  Range positions;  // the joint's range
};

/// Lists the servos of a model, in the order of its actuators: actuators that act on one hinge or
/// slide, with one input, and a force linear in the input.
std::vector<Servo> servos_in(const mjModel& model);

}  // namespace o80::mujoco
