#include "driver/model.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <type_traits>
#include <utility>

#include "balls/ball_model.hpp"
#include "engine/drawings.hpp"
#include "engine/model_files.hpp"
#include "engine/names.hpp"
#include "engine/things.hpp"
#include "engine/version.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/options.hpp"
#include "o80/describe/shown_model.hpp"

namespace o80::mujoco {
namespace {

ModelPointer compiled(const Config& config, mjSpec& spec) {
  ModelPointer model(mj_compile(&spec, nullptr));
  if (!model) {
    const std::string things =
        config.things.empty() ? "" : " with the things '" + config.things + "'";
    throw DriverError("the model '" + config.model + "'" + things +
                      " cannot be compiled: " + mjs_getError(&spec));
  }
  return model;
}

/// The model as MJCF, additions included; empty if too long for a description.
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

/// Key that is equal for equal options and files.
std::string key_of(const Config& config) {
  std::string key = state_of_files(absolute(config.model)) + '\n';
  if (!config.things.empty()) key += state_of_files(absolute(config.things));
  key += '\n' + std::to_string(std::bit_cast<std::uint64_t>(config.timestep));
  describing::each_option(config.ball_options, [&](auto, const auto& value, auto) {
    if constexpr (std::is_same_v<decltype(value), const std::string&>) {
      key += value + '\0';
    } else {
      key.append(reinterpret_cast<const char*>(&value), sizeof(value));
    }
  });
  return key;
}

bool is_hinge_or_slide(const mjModel& model, int joint) {
  return model.jnt_type[joint] == mjJNT_HINGE || model.jnt_type[joint] == mjJNT_SLIDE;
}

JointPlace place_of(const mjModel& model, int id, const Named& named) {
  Line line;
  if (!named.over.empty()) {
    Range range;
    if (model.jnt_limited[id] != 0) range = {model.jnt_range[2 * id], model.jnt_range[2 * id + 1]};
    line = spread_over(named, named.over, range);
  }
  return {named.name,
          named.joint,
          model.jnt_qposadr[id],
          model.jnt_dofadr[id],
          model.jnt_type[id] == mjJNT_SLIDE,
          !named.over.empty(),
          line};
}

/// Finds the named hinges and slides; all if no name is given.
std::vector<JointPlace> joints_in(const mjModel& model, const std::vector<Named>& all) {
  std::vector<JointPlace> joints;
  for (const Named& named : all) {
    const int id = find(model, mjOBJ_JOINT, named.joint, "joint");
    if (!is_hinge_or_slide(model, id)) {
      throw DriverError("joint '" + named.joint + "' must be a hinge or a slide: it is a ball " +
                        "joint or a free joint");
    }
    for (const JointPlace& other : joints) {
      if (other.joint != named.joint) continue;
      throw DriverError("joints: '" + named.name + "' and '" + other.name +
                        "' are the same joint of the model: name it once");
    }
    joints.push_back(place_of(model, id, named));
  }
  for (int id = 0; all.empty() && id < static_cast<int>(model.njnt); ++id) {
    if (!is_hinge_or_slide(model, id)) continue;
    const std::string name = name_of(model, mjOBJ_JOINT, id, "joint");
    joints.push_back(place_of(model, id, {name, name, {}}));
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
        "limits are for mode=actuated: mode=imposed has none, and mode=control has those of the "
        "model");
  }
  if (!config.limits.empty())
    throw DriverError("like takes the limits of the other robot: leave out limits");
  if (config.mode == JointMode::control)
    throw DriverError("like commands the joints of the model: leave out mode=control");
  if (has_balls(config.ball_options)) {
    throw DriverError("like takes the actuators of the other robot: leave out balls");
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
  if (config.model.empty()) {
    throw DriverError("no model was given: give the MJCF file with model=PATH");
  }
  file = absolute(config.model);
  MadeModel made = shared(key_of(config), [&] {
    const SpecPointer spec = parsed(config.model, "model");
    if (!config.things.empty()) add_things(*spec, config.things);
    edit(*spec);
    ModelPointer full = compiled(config, *spec);
    prepare(*full);
    std::string text = text_of(*spec);
    ModelPointer light = without_drawings(*spec, std::move(full));
    prepare(*light);
    return MadeModel{std::move(light), std::move(text)};
  });
  model = std::move(made.model);
  mjcf = std::move(made.mjcf);
  if (config.slots > 0 && (model->opt.enableflags & mjENBL_SLEEP) != 0) {
    throw DriverError(
        "bodies of the model may sleep (<flag sleep='enable'/>), and snapshots cannot store that: "
        "give slots=0, or remove the flag");
  }
  if (!config.keyframe.empty()) keyframe = find(*model, mjOBJ_KEY, config.keyframe, "keyframe");
  sensors = sensors_in(*model);
  const bool actuated = config.mode == JointMode::actuated || !config.like.empty();
  joints = joints_in(*model, actuated ? std::vector<Named>{} : named_in(config.joints));
  imposed = config.mode == JointMode::imposed && !actuated;
  spreads = imposed && std::ranges::any_of(joints, &JointPlace::spread);
  if (config.mode == JointMode::control) controls = controls_in(*model);
  if (actuated) face = joint_face(*model, config);
}

void Model::timestep(double step) { model = with_timestep(std::move(model), step); }

}  // namespace o80::mujoco
