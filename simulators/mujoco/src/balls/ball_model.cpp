#include "balls/ball_model.hpp"

#include <cmath>
#include <cstddef>

#include "balls/surface_list.hpp"
#include "engine/names.hpp"
#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

std::string copy_suffix(std::uint32_t copy) { return "_" + std::to_string(copy); }

void check_not_negative(const char* option, double value) {
  if (value >= 0 && std::isfinite(value)) return;
  throw DriverError(std::string(option) + " must be finite and not negative, got " +
                    std::to_string(value));
}

void check_numbers(const BallOptions& options) {
  check_not_negative("air_density", options.air_density);
  check_not_negative("drag_coefficient", options.drag_coefficient);
  check_not_negative("lift_coefficient", options.lift_coefficient);
  check_not_negative("lift_saturation", options.lift_saturation);
  check_not_negative("spin_decay", options.spin_decay);
  check_not_negative("teleport_distance", options.teleport_distance);
  for (const double number : options.spin) {
    if (std::isfinite(number)) continue;
    throw DriverError("spin must be three finite numbers, got " + std::to_string(number));
  }
  if (options.extra_balls > kMaxExtraBalls) {
    throw DriverError("extra_balls must be at most " + std::to_string(kMaxExtraBalls) + ", got " +
                      std::to_string(options.extra_balls));
  }
}

/// Names of all balls, extra ones last.
std::vector<std::string> ball_names(const BallOptions& options) {
  std::vector<std::string> names = entries_of(options.balls);
  for (std::uint32_t copy = 1; copy <= options.extra_balls; ++copy) {
    names.push_back(names.front() + copy_suffix(copy));
  }
  return names;
}

BallPlace ball_in(const mjModel& model, const std::string& name) {
  const int body = find(model, mjOBJ_BODY, name, "body");
  const int joint = model.body_jntadr[body];
  if (model.body_jntnum[body] != 1 || model.jnt_type[joint] != mjJNT_FREE) {
    throw DriverError("body '" + name + "' is not a ball: its only joint must be a free joint");
  }
  double radius = 0;
  for (int i = 0; i < model.body_geomnum[body]; ++i) {
    const int geom = model.body_geomadr[body] + i;
    if (model.geom_type[geom] == mjGEOM_SPHERE) radius = model.geom_size[3 * geom];
  }
  if (radius <= 0) throw DriverError("body '" + name + "' is not a ball: it has no sphere");
  // moment of inertia as a share of that of a ring: 2/3 of a hollow ball, 2/5 of a solid one
  const mjtNum* inertia = model.body_inertia + 3 * static_cast<std::ptrdiff_t>(body);
  const double mass = model.body_mass[body];
  const double mean = (inertia[0] + inertia[1] + inertia[2]) / 3;
  return {name,
          model.jnt_qposadr[joint],
          model.jnt_dofadr[joint],
          {radius, mean / (mass * radius * radius)},
          mass};
}

Shape shape_of(const mjModel& model, int geom, const std::string& name) {
  const mjtNum* size = model.geom_size + 3 * static_cast<std::ptrdiff_t>(geom);
  const Vector half{size[0], size[1], size[2]};
  switch (model.geom_type[geom]) {
    case mjGEOM_ELLIPSOID: {
      const int thin = half.x <= half.y && half.x <= half.z ? 0 : (half.y <= half.z ? 1 : 2);
      return Plate{half, thin};
    }
    case mjGEOM_BOX:
      return Box{half};
    case mjGEOM_PLANE:
      return Plane{};
    default:
      throw DriverError("balls cannot bounce on geom '" + name +
                        "': it must be an ellipsoid (an elliptic plate), a box or a plane");
  }
}

}  // namespace

bool has_balls(const BallOptions& options) {
  check_numbers(options);
  if (!entries_of(options.balls).empty()) return true;
  if (entries_of(options.surfaces).empty() && entries_of(options.watched).empty()) return false;
  throw DriverError("surfaces and watched are for balls: name the balls with balls=...");
}

void add_extra_balls(mjSpec& spec, const BallOptions& options) {
  if (options.extra_balls == 0) return;
  check_numbers(options);
  const std::vector<std::string> names = entries_of(options.balls);
  if (names.empty()) {
    throw DriverError("extra_balls adds copies of the first ball: name it with balls=...");
  }
  const mjsBody* ball = mjs_findBody(&spec, names.front().c_str());
  if (ball == nullptr) return;  // balls_in() throws
  mjs_setDeepCopy(&spec, 1);
  mjsBody* world = mjs_findBody(&spec, "world");
  for (std::uint32_t copy = 1; copy <= options.extra_balls; ++copy) {
    mjsFrame* frame = mjs_addFrame(world, nullptr);
    if (mjs_attach(frame->element, ball->element, "", copy_suffix(copy).c_str()) == nullptr) {
      throw DriverError("ball '" + names.front() + "' cannot be copied: " + mjs_getError(&spec));
    }
  }
}

void switch_off_contacts(mjModel& model, const BallOptions& options) {
  for (const std::string& name : ball_names(options)) {
    const int body = find(model, mjOBJ_BODY, name, "body");
    for (int i = 0; i < model.body_geomnum[body]; ++i) {
      const int geom = model.body_geomadr[body] + i;
      model.geom_contype[geom] = 0;
      model.geom_conaffinity[geom] = 0;
    }
  }
}

std::vector<BallPlace> balls_in(const mjModel& model, const BallOptions& options) {
  std::vector<BallPlace> balls;
  for (const std::string& name : ball_names(options)) balls.push_back(ball_in(model, name));
  return balls;
}

std::vector<SurfacePlace> surfaces_in(const mjModel& model, const BallOptions& options) {
  std::vector<SurfacePlace> surfaces;
  for (const SurfaceEntry& entry : surfaces_of(options)) {
    const int geom = find(model, mjOBJ_GEOM, entry.geom, "geom");
    const bool still = model.body_weldid[model.geom_bodyid[geom]] == 0;
    surfaces.push_back({entry.geom, geom, still, shape_of(model, geom, entry.geom),
                        entry.restitution, entry.friction, entry.watched});
  }
  return surfaces;
}

}  // namespace o80::mujoco
