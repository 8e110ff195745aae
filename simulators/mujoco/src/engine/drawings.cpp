#include "engine/drawings.hpp"

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace o80::mujoco {
namespace {

/// True if the body moves freely: it may be a ball, with an unnamed sphere.
bool is_free(const mjModel& model, int body) {
  const int first = model.body_jntadr[body];
  return first >= 0 && model.jnt_type[first] == mjJNT_FREE;
}

bool is_only_drawn(const mjModel& model, mjsElement* element) {
  const mjsGeom& geom = *mjs_asGeom(element);
  const mjsBody& body = *mjs_getParent(element);
  const int id = mjs_getId(body.element);
  return mjs_getString(mjs_getName(element))[0] == 0 && geom.contype == 0 &&
         geom.conaffinity == 0 && geom.fluid_ellipsoid == 0 &&
         (id == 0 || geom.mass == 0 || body.explicitinertial) && !is_free(model, id);
}

template <class Number>
bool equal(const Number* a, const Number* b, std::size_t count) {
  return std::ranges::equal(std::span(a, count), std::span(b, count));
}

/// True if both models have the same joints, and bodies of the same masses in the same places.
bool move_alike(const mjModel& a, const mjModel& b) {
  if (a.nbody != b.nbody || a.nq != b.nq || a.nv != b.nv || a.na != b.na || a.nu != b.nu) {
    return false;
  }
  const auto bodies = static_cast<std::size_t>(a.nbody);
  return equal(a.body_mass, b.body_mass, bodies) &&
         equal(a.body_inertia, b.body_inertia, 3 * bodies) &&
         equal(a.body_ipos, b.body_ipos, 3 * bodies) &&
         equal(a.body_iquat, b.body_iquat, 4 * bodies) &&
         equal(a.body_pos, b.body_pos, 3 * bodies) && equal(a.body_quat, b.body_quat, 4 * bodies);
}

}  // namespace

ModelPointer without_drawings(mjSpec& spec, ModelPointer full) {
  if (full->nsensor > 0 || full->nplugin > 0) return full;
  std::vector<mjsElement*> drawings;
  for (mjsElement* geom = mjs_firstElement(&spec, mjOBJ_GEOM); geom != nullptr;
       geom = mjs_nextElement(&spec, geom)) {
    if (is_only_drawn(*full, geom)) drawings.push_back(geom);
  }
  if (drawings.empty()) return full;
  for (mjsElement* geom : drawings) {
    if (mjs_delete(&spec, geom) != 0) return full;
  }
  ModelPointer light(mj_compile(&spec, nullptr));
  return light && move_alike(*full, *light) ? std::move(light) : std::move(full);
}

}  // namespace o80::mujoco
