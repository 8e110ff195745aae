#include "driver/model.hpp"

#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

#include "engine/drawings.hpp"
#include "engine/names.hpp"
#include "engine/version.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/shown_model.hpp"

namespace o80::mujoco {
namespace {

SpecPointer parsed(const std::string& path) {
  if (path.empty()) throw DriverError("no model was given: give the MJCF file with model=PATH");
  std::array<char, 1024> error{};
  SpecPointer spec(mj_parseXML(path.c_str(), nullptr, error.data(), error.size()));
  if (!spec) throw DriverError("the model '" + path + "' cannot be read: " + error.data());
  return spec;
}

ModelPointer compiled(const std::string& path, mjSpec& spec) {
  ModelPointer model(mj_compile(&spec, nullptr));
  if (!model) {
    throw DriverError("the model '" + path + "' cannot be compiled: " + mjs_getError(&spec));
  }
  return model;
}

/// The model as MJCF, with what was added to it; empty if it is longer than a description takes.
std::string text_of(const mjSpec& spec) {
  std::string text(std::size_t{1} << 14, '\0');
  for (int tries = 0; tries < 2; ++tries) {
    const int wanted =
        mj_saveXMLString(&spec, text.data(), static_cast<int>(text.size()), nullptr, 0);
    if (wanted < 0 || static_cast<std::size_t>(wanted) > ShownModel::kLargest) return "";
    if (wanted == 0) return text.c_str();
    text.assign(static_cast<std::size_t>(wanted) + 1, '\0');
  }
  return "";
}

std::string absolute(const std::string& path) {
  std::error_code failed;
  const std::filesystem::path found = std::filesystem::absolute(path, failed);
  return failed ? path : found.lexically_normal().string();
}

bool is_hinge_or_slide(const mjModel& model, int joint) {
  return model.jnt_type[joint] == mjJNT_HINGE || model.jnt_type[joint] == mjJNT_SLIDE;
}

/// The named hinges and slides; all of them if no name is given.
std::vector<JointPlace> joints_in(const mjModel& model, const std::vector<std::string>& names) {
  std::vector<int> ids;
  for (const std::string& name : names) {
    const int id = find(model, mjOBJ_JOINT, name, "joint");
    if (!is_hinge_or_slide(model, id)) {
      throw DriverError("joint '" + name + "' must be a hinge or a slide: it is a ball joint or " +
                        "a free joint");
    }
    ids.push_back(id);
  }
  for (int id = 0; names.empty() && id < static_cast<int>(model.njnt); ++id) {
    if (is_hinge_or_slide(model, id)) ids.push_back(id);
  }
  std::vector<JointPlace> joints;
  joints.reserve(ids.size());
  for (const int id : ids) {
    joints.push_back({name_of(model, mjOBJ_JOINT, id, "joint"), model.jnt_qposadr[id],
                      model.jnt_dofadr[id], model.jnt_type[id] == mjJNT_SLIDE});
  }
  return joints;
}

std::vector<SensorPlace> sensors_in(const mjModel& model) {
  std::vector<SensorPlace> sensors;
  sensors.reserve(static_cast<std::size_t>(model.nsensor));
  for (int i = 0; i < static_cast<int>(model.nsensor); ++i) {
    sensors.push_back(
        {name_of(model, mjOBJ_SENSOR, i, "sensor"), model.sensor_adr[i], model.sensor_dim[i]});
  }
  return sensors;
}

std::vector<ControlPlace> controls_in(const mjModel& model) {
  std::vector<ControlPlace> controls;
  for (int i = 0; i < static_cast<int>(model.nactuator); ++i) {
    const std::string name = name_of(model, mjOBJ_ACTUATOR, i, "control");
    const int inputs = model.actuator_ctrlnum[i];
    for (int n = 0; n < inputs; ++n) {
      const int at = model.actuator_ctrladr[i] + n;
      controls.push_back({inputs == 1 ? name : name + "_" + std::to_string(n), at,
                          model.actuator_ctrllimited[at] != 0, model.actuator_ctrlrange[2 * at],
                          model.actuator_ctrlrange[2 * at + 1]});
    }
  }
  if (controls.empty()) {
    throw DriverError(
        "the model has no actuators to control: add an <actuator> to it, or give mode=imposed");
  }
  return controls;
}

void check_options(const Config& config) {
  if (config.like.empty()) {
    if (config.limits.empty() || config.mode == JointMode::actuated) return;
    throw DriverError(
        "limits are for mode=actuated: mode imposed has none, control those of the "
        "model");
  }
  if (!config.limits.empty())
    throw DriverError("with like the limits are those of the other robot");
  if (config.mode == JointMode::control)
    throw DriverError("like drives the joints: leave out mode=control");
  if (has_balls(config.ball_options)) {
    throw DriverError("with like all actuators are those of the other robot: leave out balls");
  }
}

}  // namespace

Model::Model(const Config& config, const std::function<void(mjSpec&)>& edit,
             const std::function<void(mjModel&)>& finish) {
  check_version(mj_version(), mj_versionString());
  check_options(config);
  if (!(config.timestep >= 0 && std::isfinite(config.timestep))) {
    throw DriverError("timestep must be finite and positive [s], or 0 for the model's, got " +
                      std::to_string(config.timestep));
  }
  const auto prepare = [&](mjModel& each) {
    if (config.timestep > 0) each.opt.timestep = config.timestep;
    // a simulation that diverges is a fault, not a silent restart
    each.opt.disableflags |= mjDSBL_AUTORESET;
    finish(each);
  };
  const SpecPointer spec = parsed(config.model);
  edit(*spec);
  ModelPointer full = compiled(config.model, *spec);
  prepare(*full);
  file = absolute(config.model);
  MadeModel made = shared(file, *full, [&] {
    std::string text = text_of(*spec);
    ModelPointer light = without_drawings(*spec, std::move(full));
    prepare(*light);
    return MadeModel{std::move(light), std::move(text)};
  });
  model = std::move(made.model);
  mjcf = std::move(made.mjcf);
  if (!config.keyframe.empty()) keyframe = find(*model, mjOBJ_KEY, config.keyframe, "keyframe");
  sensors = sensors_in(*model);
  const bool actuated = config.mode == JointMode::actuated || !config.like.empty();
  joints = joints_in(*model, actuated ? std::vector<std::string>{} : entries_of(config.joints));
  imposed = config.mode == JointMode::imposed && !actuated;
  if (config.mode == JointMode::control) controls = controls_in(*model);
  if (actuated) face = joint_face(*model, config);
}

void Model::timestep(double step) { model = with_timestep(std::move(model), step); }

}  // namespace o80::mujoco
