#pragma once

#include <mujoco/mujoco.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "driver/config.hpp"
#include "engine/servos.hpp"
#include "o80/describe/schema.hpp"

namespace o80::mujoco {

/// Entry of the option `joints`: `elbow`, `elbow=j2` or `jaw=j6 0 1`.
struct Named {
  std::string name;
  std::string joint;
  std::vector<double> over;  // the number at both ends of the joint's range, or empty
};
/// Throws DriverError.
std::vector<Named> named_in(const std::string& list);
/// Conversion from a number in `over` to the range of a joint. Throws DriverError without a range.
Line spread_over(const Named& named, const std::vector<double>& over, const Range& range);

/// Joints of a model as actuators of o80, each driven by a servo, with the model's face
/// (mode actuated) or another robot's (like).
struct JointFace {
  /// Input of the model's actuators.
  struct Input {
    std::uint32_t offset;  // place of the input's number in the states
    Line line;             // from that number to ctrl
    int control;           // address in ctrl
    int position;          // address in qpos of the held value after a reset; -1: 0
    Line hold;             // from there to ctrl
    int actuator;          // id
    bool weakens;          // changed by the request strength: not a gripper, which has its own
  };
  /// Request of arms that a simulation also serves.
  enum class Word : std::uint8_t { none, hold, relax, strength, recover };
  /// Source of a number of a row.
  struct Number {
    std::uint32_t offset;
    Quantity quantity;  // none: a sensor
    int joint;          // id
    int address;        // in qpos, in qvel and its forces, or in sensordata
    Line line;          // from the number to the joint's number
  };

  /// Description of the actuators; with like, also of sensor values, requests and period (0: any).
  Schema schema;
  std::vector<Input> inputs;
  std::vector<Number> states;
  std::vector<Number> sensors;
  std::vector<std::uint32_t> capture_times;
  std::vector<Word> words;        // of the requests
  std::vector<std::byte> absent;  // sensor values: NaN or 0 if missing in the model

  /// True if a state has the position of this address in qpos.
  bool moves(int position) const noexcept;
  bool is_shown(const mjModel& model, const Number& number) const;
  /// Describes the joints that the states move, for viewers.
  void show(const mjModel& model, ShownModel& shown) const;
  /// Sets the inputs from the states.
  void drive(const std::byte* block, mjData& data) const noexcept;
  /// Changes the inputs so that no actuator exceeds this share of its largest force; 0: no force
  /// at all.
  void weaken(double share, const mjModel& model, mjData& data) const noexcept;
  /// Sets the inputs to hold the joints.
  void hold(mjData& data) const noexcept;
  /// Writes the observed numbers of the states; numbers without a joint are not changed.
  void observe(const mjData& data, std::byte* block) const noexcept;
  void extend(const mjData& data, std::int64_t time, std::byte* extended) const noexcept;
};

/// Throws DriverError if a joint or its actuator is missing or does not support the face.
JointFace joint_face(const mjModel& model, const Config& config);

}  // namespace o80::mujoco
