#include "driver/model.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

struct DeleteSpec {
  void operator()(mjSpec* spec) const noexcept { mj_deleteSpec(spec); }
};
using SpecPointer = std::unique_ptr<mjSpec, DeleteSpec>;

/// 4000001 => "4.0.1"
std::string version_text(int version) {
  return std::to_string(version / 1'000'000) + "." + std::to_string(version / 1000 % 1000) + "." +
         std::to_string(version % 1000);
}

std::string name_of(const mjModel& model, mjtObj kind, int id, const char* fallback) {
  const char* name = mj_id2name(&model, kind, id);
  return name != nullptr && *name != 0 ? name : fallback + std::string("_") + std::to_string(id);
}

int count_of(const mjModel& model, mjtObj kind) {
  switch (kind) {
    case mjOBJ_BODY:
      return static_cast<int>(model.nbody);
    case mjOBJ_JOINT:
      return static_cast<int>(model.njnt);
    case mjOBJ_GEOM:
      return static_cast<int>(model.ngeom);
    case mjOBJ_KEY:
      return static_cast<int>(model.nkey);
    default:
      return 0;
  }
}

/// The id of a name; the error lists those there are.
int find(const mjModel& model, mjtObj kind, const std::string& name, const char* what) {
  const int id = mj_name2id(&model, kind, name.c_str());
  if (id >= 0) return id;
  std::string there;
  for (int i = 0; i < count_of(model, kind); ++i) {
    const char* known = mj_id2name(&model, kind, i);
    if (known != nullptr && *known != 0) there += (there.empty() ? "" : ", ") + std::string(known);
  }
  throw DriverError("the model has no " + std::string(what) + " '" + name +
                    "'; there are: " + (there.empty() ? "none" : there));
}

SpecPointer parsed(const std::string& path) {
  if (path.empty())
    throw DriverError("no model was given: model=PATH is the MJCF file to simulate");
  std::array<char, 1024> error{};
  SpecPointer spec(mj_parseXML(path.c_str(), nullptr, error.data(), error.size()));
  if (!spec) throw DriverError("the model '" + path + "' cannot be read: " + error.data());
  return spec;
}

void add_copies(mjSpec& spec, const std::string& ball, std::uint32_t copies) {
  mjsBody* body = mjs_findBody(&spec, ball.c_str());
  if (copies == 0 || body == nullptr) return;
  mjs_setDeepCopy(&spec, 1);
  mjsBody* world = mjs_findBody(&spec, "world");
  for (std::uint32_t i = 1; i <= copies; ++i) {
    mjsFrame* frame = mjs_addFrame(world, nullptr);
    const std::string suffix = "_" + std::to_string(i);
    if (mjs_attach(frame->element, body->element, "", suffix.c_str()) == nullptr) {
      throw DriverError("ball '" + ball + "' cannot be copied: " + mjs_getError(&spec));
    }
  }
}

ModelPointer compiled(const Config& config, const std::vector<std::string>& balls) {
  const SpecPointer spec = parsed(config.model);
  if (config.extra_balls > 0 && balls.empty()) {
    throw DriverError("extra_balls copies the first ball: name it with balls=...");
  }
  if (!balls.empty()) add_copies(*spec, balls.front(), config.extra_balls);
  ModelPointer model(mj_compile(spec.get(), nullptr));
  if (!model) {
    throw DriverError("the model '" + config.model +
                      "' cannot be compiled: " + mjs_getError(spec.get()));
  }
  return model;
}

bool is_hinge_or_slide(const mjModel& model, int joint) {
  return model.jnt_type[joint] == mjJNT_HINGE || model.jnt_type[joint] == mjJNT_SLIDE;
}

std::vector<JointPlace> joints_of(const mjModel& model, const std::vector<std::string>& names) {
  std::vector<int> ids;
  for (const std::string& name : names) {
    const int id = find(model, mjOBJ_JOINT, name, "joint");
    if (!is_hinge_or_slide(model, id)) {
      throw DriverError("joint '" + name + "' is no hinge and no slide: it has more than a number");
    }
    ids.push_back(id);
  }
  for (int id = 0; names.empty() && id < static_cast<int>(model.njnt); ++id) {
    if (is_hinge_or_slide(model, id)) ids.push_back(id);
  }
  std::vector<JointPlace> joints;
  joints.reserve(ids.size());
  for (const int id : ids) {
    joints.push_back({name_of(model, mjOBJ_JOINT, id, "joint"), id, model.jnt_qposadr[id],
                      model.jnt_dofadr[id]});
  }
  return joints;
}

BallPlace ball_of(mjModel& model, const std::string& name) {
  const int body = find(model, mjOBJ_BODY, name, "body");
  const int joint = model.body_jntadr[body];
  if (model.body_jntnum[body] != 1 || model.jnt_type[joint] != mjJNT_FREE) {
    throw DriverError("body '" + name + "' is no ball: it needs a free joint, and no other");
  }
  double radius = 0;
  for (int i = 0; i < model.body_geomnum[body]; ++i) {
    const int geom = model.body_geomadr[body] + i;
    if (model.geom_type[geom] == mjGEOM_SPHERE) radius = model.geom_size[3 * geom];
    // its contacts are ours
    model.geom_contype[geom] = 0;
    model.geom_conaffinity[geom] = 0;
  }
  if (radius <= 0) throw DriverError("body '" + name + "' is no ball: it has no sphere");
  return {
      name, body, model.jnt_qposadr[joint], model.jnt_dofadr[joint], radius, model.body_mass[body]};
}

SurfacePlace surface_of(const mjModel& model, SurfaceKind kind, const std::string& name,
                        const Restitution& restitution) {
  const int geom = find(model, mjOBJ_GEOM, name, "geom");
  const mjtNum* size = model.geom_size + 3 * static_cast<std::ptrdiff_t>(geom);
  const Vector half{size[0], size[1], size[2]};
  SurfacePlace place{kind, geom, model.body_weldid[model.geom_bodyid[geom]] == 0, Plane{},
                     restitution};
  switch (model.geom_type[geom]) {
    case mjGEOM_ELLIPSOID: {
      const int thin = half.x <= half.y && half.x <= half.z ? 0 : (half.y <= half.z ? 1 : 2);
      place.shape = Blade{half, thin};
      break;
    }
    case mjGEOM_BOX:
      place.shape = Box{half};
      break;
    case mjGEOM_PLANE:
      break;
    default:
      throw DriverError("balls cannot bounce on geom '" + name +
                        "': it must be an ellipsoid (an elliptic blade), a box or a plane");
  }
  for (const double share : restitution) {
    if (!(share >= 0 && share <= 1)) {
      throw DriverError("the restitution of '" + name + "' must be shares from 0 to 1");
    }
  }
  return place;
}

}  // namespace

const char* built_with() {
  static const std::string text = "mujoco " + version_text(mjVERSION_HEADER);
  return text.c_str();
}

void check_version(int library, const char* library_text) {
  if (library == mjVERSION_HEADER) return;
  const std::string built = version_text(mjVERSION_HEADER);
  throw DriverError("the simulator 'mujoco' was built for MuJoCo " + built + ", but MuJoCo " +
                    library_text + " is loaded. Install the one it was built for (pip install " +
                    "mujoco-core==" + built + "), or build o80 again with the one that is there");
}

std::vector<std::string> names_in(std::string_view list) {
  std::vector<std::string> names;
  while (!list.empty()) {
    const auto comma = list.find(',');
    std::string_view name = list.substr(0, comma);
    list.remove_prefix(comma == std::string_view::npos ? list.size() : comma + 1);
    while (!name.empty() && name.front() == ' ') name.remove_prefix(1);
    while (!name.empty() && name.back() == ' ') name.remove_suffix(1);
    if (!name.empty()) names.emplace_back(name);
  }
  return names;
}

Model::Model(const Config& config) {
  check_version(mj_version(), mj_versionString());
  std::vector<std::string> ball_names = names_in(config.balls);
  model = compiled(config, ball_names);
  if (config.timestep > 0) model->opt.timestep = config.timestep;
  // a simulation that diverges is a fault, not a silent new start
  model->opt.disableflags |= mjDSBL_AUTORESET;
  if (!config.keyframe.empty()) {
    keyframe = find(*model, mjOBJ_KEY, config.keyframe, "keyframe");
  }

  for (std::uint32_t i = 1; i <= config.extra_balls; ++i) {
    ball_names.push_back(ball_names.front() + "_" + std::to_string(i));
  }
  for (const std::string& name : ball_names) balls.push_back(ball_of(*model, name));
  joints = joints_of(*model, names_in(config.joints));

  const auto add_surfaces = [&](SurfaceKind kind, const std::string& names,
                                const Restitution& restitution) {
    for (const std::string& name : names_in(names)) {
      surfaces.push_back(surface_of(*model, kind, name, restitution));
    }
  };
  add_surfaces(SurfaceKind::racket, config.racket, config.racket_restitution);
  add_surfaces(SurfaceKind::table, config.table, config.table_restitution);
  add_surfaces(SurfaceKind::net, config.net, config.net_restitution);
  add_surfaces(SurfaceKind::floor, config.floor, config.floor_restitution);

  for (int i = 0; i < static_cast<int>(model->nsensor); ++i) {
    sensors.push_back(
        {name_of(*model, mjOBJ_SENSOR, i, "sensor"), model->sensor_adr[i], model->sensor_dim[i]});
  }
  if (config.mode == JointMode::control) {
    for (int i = 0; i < static_cast<int>(model->nactuator); ++i) {
      const std::string name = name_of(*model, mjOBJ_ACTUATOR, i, "control");
      const int numbers = model->actuator_ctrlnum[i];
      for (int n = 0; n < numbers; ++n) {
        const int at = model->actuator_ctrladr[i] + n;
        controls.push_back({numbers == 1 ? name : name + "_" + std::to_string(n), at,
                            model->actuator_ctrllimited[at] != 0, model->actuator_ctrlrange[2 * at],
                            model->actuator_ctrlrange[2 * at + 1]});
      }
    }
    if (controls.empty()) {
      throw DriverError("the model has no actuators to control: give it some, or say mode=imposed");
    }
  }
  const std::size_t imposed = config.mode == JointMode::imposed ? joints.size() : 0;
  driven = imposed + 6 * balls.size() == static_cast<std::size_t>(model->nv) && model->na == 0;
}

}  // namespace o80::mujoco
