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

/// An entry of the option `joints`: `elbow`, `elbow=j2` or `jaw=j6 0 1`.
struct Named {
  std::string name;
  std::string joint;
  std::vector<double> over;  // the number at both ends of the joint's range, or empty
};
/// Throws DriverError.
std::vector<Named> named_in(const std::string& list);
/// From a number in `over` to one in the range of this joint. Throws DriverError if it has none.
Line spread_over(const Named& named, const std::vector<double>& over, const Range& range);

/// The joints of a model as actuators of o80, each driven by its servo, with the face that the
/// model gives (mode actuated) or that of another robot (like).
struct JointFace {
  /// One input of the model's actuators.
  struct Input {
    std::uint32_t offset;  // of the number that it takes, in the states
    Line line;             // from that number to ctrl
    int control;           // address in ctrl
    int position;          // address in qpos of what it holds after a reset; -1: it takes 0
    Line hold;             // from there to ctrl
    int actuator;          // id
    bool weakens;          // by the request strength: not a gripper, which has one of its own
  };
  /// A request of arms that a simulation serves too.
  enum class Word : std::uint8_t { none, hold, relax, strength, recover };
  /// Where a number of a row comes from.
  struct Number {
    std::uint32_t offset;
    Quantity quantity;  // none: a sensor
    int joint;          // id
    int address;        // in qpos, in qvel and its forces, or in sensordata
    Line line;          // from the number to that of the joint
  };

  /// The actuators; with like also sensor values, requests and the period (0: any).
  Schema schema;
  std::vector<Input> inputs;
  std::vector<Number> states;
  std::vector<Number> sensors;
  std::vector<std::uint32_t> capture_times;
  std::vector<Word> words;        // of the requests
  std::vector<std::byte> absent;  // sensor values: NaN or 0 where the model has none

  /// True if a state has the position of this address in qpos.
  bool moves(int position) const noexcept;
  bool is_shown(const mjModel& model, const Number& number) const;
  /// Names the joints that the states move, for viewers.
  void show(const mjModel& model, ShownModel& shown) const;
  /// Sets the inputs as the states say.
  void drive(const std::byte* block, mjData& data) const noexcept;
  /// Changes the inputs so that no actuator gives more than this share of its largest force; for 0
  /// none gives any.
  void weaken(double share, const mjModel& model, mjData& data) const noexcept;
  /// Sets the inputs so that the joints stay.
  void hold(mjData& data) const noexcept;
  /// Observed numbers of the states; those that no joint has are left.
  void observe(const mjData& data, std::byte* block) const noexcept;
  void extend(const mjData& data, std::int64_t time, std::byte* extended) const noexcept;
};

/// Throws DriverError: a joint or its actuator is missing, or it cannot do what the face says.
JointFace joint_face(const mjModel& model, const Config& config);

}  // namespace o80::mujoco
