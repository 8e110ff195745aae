#pragma once

#include <functional>
#include <string>
#include <vector>

#include "driver/config.hpp"
#include "engine/shared_models.hpp"

namespace o80::mujoco {

/// One hinge or slide.
struct JointPlace {
  std::string name;
  int position;  // in qpos
  int velocity;  // in qvel
};

/// One sensor of the model: a number or a vector.
struct SensorPlace {
  std::string name;
  int address;  // in sensordata
  int numbers;
};

/// One input of an actuator of the model.
struct ControlPlace {
  std::string name;
  int address;  // in ctrl
  bool limited;
  double minimum, maximum;
};

/// A compiled model, and the addresses of its joints, actuators and sensors.
///
/// Move-only.
struct Model {
  /// `edit` may change the model before it is compiled, `finish` after that. Throws DriverError.
  Model(const Config& config, const std::function<void(mjSpec&)>& edit,
        const std::function<void(mjModel&)>& finish);

  SharedModel model;
  std::string mjcf;  // the compiled model as text, for viewers; empty if it is too large
  std::string file;  // absolute path of the model
  int keyframe = -1;
  std::vector<JointPlace> joints;
  std::vector<ControlPlace> controls;  // empty if joints are imposed
  std::vector<SensorPlace> sensors;
};

}  // namespace o80::mujoco
