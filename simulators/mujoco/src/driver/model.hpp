#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "balls/surface.hpp"
#include "driver/config.hpp"

namespace o80::mujoco {

struct DeleteModel {
  void operator()(mjModel* model) const noexcept { mj_deleteModel(model); }
};
struct DeleteData {
  void operator()(mjData* data) const noexcept { mj_deleteData(data); }
};
using ModelPointer = std::unique_ptr<mjModel, DeleteModel>;
using DataPointer = std::unique_ptr<mjData, DeleteData>;

/// The MuJoCo that this was built with: "mujoco 4.0.1".
const char* built_with();

/// Throws DriverError, naming both versions and the cure, unless this library is the one that o80
/// was built with.
void check_version(int library, const char* library_text);

/// The names in a comma-separated list.
std::vector<std::string> names_in(std::string_view list);

/// One hinge or slide.
struct JointPlace {
  std::string name;
  int id;
  int position;  // in qpos
  int velocity;  // in qvel
};

/// One free body that is a ball.
struct BallPlace {
  std::string name;
  int body;
  int position;   // in qpos
  int velocity;   // in qvel
  double radius;  // [m]
  double mass;    // [kg]
};

/// One geom that balls bounce on.
struct SurfacePlace {
  SurfaceKind kind;
  int geom;
  bool still;  // part of the world
  Shape shape;
  Restitution restitution;
};

/// One number or vector that the model's sensors give.
struct SensorPlace {
  std::string name;
  int address;  // in sensordata
  int numbers;
};

/// One number that an actuator of the model takes.
struct ControlPlace {
  std::string name;
  int address;  // in ctrl
  bool limited;
  double minimum, maximum;
};

/// A compiled model and where in it is what a driver works with.
///
/// Move-only. Throws DriverError, whose text lists what the model has.
struct Model {
  explicit Model(const Config& config);

  ModelPointer model;
  int keyframe = -1;
  std::vector<JointPlace> joints;
  std::vector<ControlPlace> controls;  // empty if joints are imposed
  std::vector<BallPlace> balls;
  std::vector<SurfacePlace> surfaces;
  std::vector<SensorPlace> sensors;
  bool driven = false;  // every degree of freedom is imposed or a ball's: nothing to integrate
};

}  // namespace o80::mujoco
