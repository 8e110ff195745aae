#include "driver/model.hpp"

#include <filesystem>
#include <memory>

#include "scenes.hpp"

namespace o80::mujoco {
namespace {

using ModelTest = SceneTest;

TEST_F(ModelTest, IsCompiledOnceForAllThatUseItUntilAFileOfItChanges) {
  std::filesystem::create_directory(directory_.path() + "/meshes");
  const std::string wedge = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\n";
  const std::string parts = "<mujoco><asset><mesh name='wedge' file='wedge.obj'/></asset></mujoco>";
  const std::string things = "<mujoco><worldbody><body name='thing'/></worldbody></mujoco>";
  file("meshes/wedge.obj", wedge);
  file("parts.xml", parts);
  Config config;
  config.things = file("things.xml", things);
  config.model = file("arm.xml",
                      "<mujoco><compiler meshdir='meshes'/><include file=\"parts.xml\"/><worldbody>"
                      "<body><joint name='j'/><geom size='0.1'/></body></worldbody></mujoco>");
  int compiled = 0;
  const auto make = [&] {
    return std::make_unique<Model>(config, [&](mjSpec&) { ++compiled; }, [](mjModel&) {});
  };
  const auto first = make();
  EXPECT_EQ(make()->model, first->model);
  EXPECT_EQ(make()->mjcf, first->mjcf);
  EXPECT_EQ(compiled, 1);
  file("meshes/wedge.obj", wedge + "f 2 3 4\n");
  const auto second = make();
  EXPECT_EQ(compiled, 2);
  file("parts.xml", parts + " ");
  const auto third = make();
  EXPECT_EQ(compiled, 3);
  config.things = file("things.xml", things + " ");
  const auto fourth = make();
  EXPECT_EQ(make()->model, fourth->model);
  EXPECT_EQ(compiled, 4);
}

}  // namespace
}  // namespace o80::mujoco
