#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "driver/config.hpp"
#include "driver/joint_face.hpp"
#include "engine/shared_models.hpp"

namespace o80::mujoco {

/// Hinge or slide.
struct JointPlace {
  std::string name;   // name as an actuator
  std::string joint;  // name in the model
  int position;       // in qpos
  int velocity;       // in qvel
  bool slides;        // else it turns
  bool spread;        // the actuator's position differs from the joint's
  Line line;          // from the actuator's number to the joint's
};

/// Sensor of the model: a number or a vector.
struct SensorPlace {
  std::string name;
  int address;  // in sensordata
  int numbers;
};

/// Input of an actuator of the model.
struct ControlPlace {
  std::string name;
  int address;  // in ctrl
  bool limited;
  double minimum, maximum;
};

/// Compiled model, and the addresses of its joints, actuators and sensors.
///
/// Move-only.
struct Model {
  /// `edit` may change the model before its compilation, `finish` afterwards. Throws DriverError.
  Model(const Config& config, const std::function<void(mjSpec&)>& edit,
        const std::function<void(mjModel&)>& finish);

  SharedModel model;
  std::string mjcf;  // the compiled model as text, for viewers; empty if it is too large
  std::string file;  // absolute path of the model
  int keyframe = -1;
  std::vector<JointPlace> joints;
  bool imposed;                        // joints are set; else the inputs of actuators are
  bool spreads;                        // imposed, and one of them is spread
  std::vector<ControlPlace> controls;  // of mode control
  std::optional<JointFace> face;       // of mode actuated, or of another robot
  std::vector<SensorPlace> sensors;

  /// Changes the step of the engine [s].
  void timestep(double step);
};

}  // namespace o80::mujoco
