#include "engine/drawings.hpp"

#include <gtest/gtest.h>

#include <string>

#include "models.hpp"

namespace o80::mujoco {
namespace {

/// A hanging body with a named geom, and these geoms and sensors.
std::string hanging(const std::string& geoms, const std::string& sensors = "",
                    const std::string& inertial = "") {
  return "<mujoco><default><default class='drawn'>"
         "<geom contype='0' conaffinity='0' mass='0' size='0.1'/></default></default>"
         "<worldbody><geom class='drawn'/><geom name='ground' type='plane' size='1 1 1'/>"
         "<body pos='0 0 1'>" +
         inertial + "<joint axis='0 1 0'/><geom name='bob' type='box' size='0.1 0.1 0.3'/>" +
         geoms + "</body></worldbody><sensor>" + sensors + "</sensor></mujoco>";
}

/// Geoms that are left of a model.
int left_of(const std::string& mjcf) {
  const SpecPointer spec = spec_of(mjcf);
  return static_cast<int>(without_drawings(*spec, model_of(*spec))->ngeom);
}

constexpr const char* kDrawn =
    "<geom class='drawn'/><geom class='drawn' type='capsule' size='0.1 0.2'/>";

TEST(Drawings, AreLeftOutOfTheModel) {
  EXPECT_EQ(left_of(hanging("")), 2);
  EXPECT_EQ(left_of(hanging(kDrawn)), 2);
  EXPECT_EQ(left_of("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>"), 1);
}

TEST(Drawings, AreLeftOutInFramesReplicasAndMeshesToo) {
  EXPECT_EQ(left_of(hanging("<replicate count='5' offset='0 0 0.1'><geom class='drawn'/>"
                            "</replicate><frame pos='1 0 0'><geom class='drawn'/></frame>")),
            2);
  std::string meshes = hanging("<geom class='drawn' type='mesh' mesh='wedge'/>");
  meshes.insert(meshes.find("<worldbody>"),
                "<asset><mesh name='wedge' vertex='0 0 0  1 0 0  0 1 0  0 0 1'/></asset>");
  EXPECT_EQ(left_of(meshes), 2);
}

TEST(Drawings, AreNoGeomsThatAreNamedOrTouchOrWeighOrFeelAnything) {
  for (const char* geom :
       {"<geom class='drawn' name='marker'/>", "<geom class='drawn' contype='1'/>",
        "<geom class='drawn' conaffinity='1'/>", "<geom class='drawn' mass='0.1'/>",
        "<geom contype='0' conaffinity='0' size='0.1'/>",
        "<geom class='drawn' fluidshape='ellipsoid'/>"}) {
    EXPECT_EQ(left_of(hanging(geom)), 3) << geom;
  }
}

TEST(Drawings, MayHaveAMassThatDoesNotCount) {
  const char* inertial = "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>";
  EXPECT_EQ(left_of(hanging("<geom class='drawn' mass='5'/>", "", inertial)), 2);
  // unless the compiler is told to count it: then the model is not changed at all
  std::string counted = hanging("<geom class='drawn' mass='5'/>", "", inertial);
  counted.insert(counted.find("<default>"), "<compiler inertiafromgeom='true'/>");
  EXPECT_EQ(left_of(counted), 4);
}

TEST(Drawings, StayWhereSensorsMaySeeThem) {
  EXPECT_EQ(left_of(hanging(kDrawn, "<clock name='clock'/>")), 5);
}

TEST(Drawings, AreNoSpheresOfBalls) {
  EXPECT_EQ(left_of("<mujoco><worldbody><body><freejoint/>"
                    "<inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
                    "<geom size='0.02' contype='0' conaffinity='0'/></body></worldbody></mujoco>"),
            1);
}

TEST(Drawings, ChangeNothingInTheMotion) {
  const SpecPointer spec = spec_of(hanging(kDrawn));
  const SpecPointer same = spec_of(hanging(kDrawn));
  const ModelPointer full = model_of(*same);
  const ModelPointer light = without_drawings(*spec, model_of(*spec));
  ASSERT_LT(light->ngeom, full->ngeom);
  const DataPointer a(mj_makeData(full.get())), b(mj_makeData(light.get()));
  a->qvel[0] = b->qvel[0] = 3;
  for (int i = 0; i < 500; ++i) {
    mj_step(full.get(), a.get());
    mj_step(light.get(), b.get());
    ASSERT_EQ(a->qpos[0], b->qpos[0]);
    ASSERT_EQ(a->ncon, b->ncon);
  }
  EXPECT_NE(a->qpos[0], 0);
}

}  // namespace
}  // namespace o80::mujoco
