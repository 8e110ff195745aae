#include "balls/carried.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "expect_near.hpp"
#include "models.hpp"

namespace o80::mujoco {
namespace {

using Random = std::mt19937;

double drawn(Random& random) { return std::uniform_real_distribution(-1.0, 1.0)(random); }

std::string three(Random& random) {
  return std::to_string(drawn(random)) + " " + std::to_string(drawn(random)) + " " +
         std::to_string(drawn(random));
}

/// A chain of five bodies, each with up to two joints of any kind, beside a body that moves alone.
std::string chain(Random& random) {
  std::string bodies, ends;
  for (int body = 0; body < 5; ++body) {
    bodies += "<body pos='" + three(random) + "' euler='" + three(random) + "'>";
    const int kind = std::uniform_int_distribution(0, 5)(random);
    const std::string place = "' pos='" + three(random) + "' axis='" + three(random) + "'/>";
    if (body == 0 && kind == 0) bodies += "<freejoint/>";
    if (kind == 1 || kind == 4) bodies += "<joint type='hinge" + place;
    if (kind == 2 || kind == 4 || kind == 5) bodies += "<joint type='slide" + place;
    if (kind == 3 || kind == 5) bodies += "<joint type='ball' pos='" + three(random) + "'/>";
    bodies += "<geom type='box' size='0.1 0.2 0.3' pos='" + three(random) + "'/>";
    ends += "</body>";
  }
  return "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body>" + bodies + ends +
         "</worldbody></mujoco>";
}

TEST(Carried, IsWhatTheEngineSaysOfEachGeom) {
  Random random(1);
  int moving = 0;
  for (int n = 0; n < 300; ++n) {
    const SpecPointer spec = spec_of(chain(random));
    const ModelPointer model = model_of(*spec);
    const DataPointer data(mj_makeData(model.get()));
    for (int i = 0; i < static_cast<int>(model->nq); ++i) data->qpos[i] += drawn(random);
    for (int i = 0; i < static_cast<int>(model->nv); ++i) data->qvel[i] = 10 * drawn(random);
    mj_normalizeQuat(model.get(), data->qpos);
    mj_kinematics(model.get(), data.get());
    mj_comPos(model.get(), data.get());
    mj_comVel(model.get(), data.get());
    for (int geom = 0; geom < static_cast<int>(model->ngeom); ++geom) {
      mjtNum expected[6];
      mj_objectVelocity(model.get(), data.get(), mjOBJ_GEOM, geom, expected, 0);
      const mjtNum* at = data->geom_xpos + 3 * static_cast<std::ptrdiff_t>(geom);
      const Carried carried = carried_by(joints_under(*model, model->geom_bodyid[geom]), *model,
                                         *data, {at[0], at[1], at[2]});
      expect_near(carried.spin, {expected[0], expected[1], expected[2]}, 1e-11);
      expect_near(carried.velocity, {expected[3], expected[4], expected[5]}, 1e-11);
      moving += length(carried.velocity) > 0.1 ? 1 : 0;
    }
  }
  EXPECT_GT(moving, 900);
}

TEST(Carried, IsAtRestInTheWorld) {
  const SpecPointer spec = spec_of("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>");
  const ModelPointer model = model_of(*spec);
  EXPECT_TRUE(joints_under(*model, 0).empty());
}

}  // namespace
}  // namespace o80::mujoco
