#include "driver/simulation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "count_allocations.hpp"
#include "scenes.hpp"

namespace o80::mujoco {
namespace {

Config config_of(const OptionValues& options) {
  Config config;
  for (const auto& [name, text] : options) set_option(config, name, text);
  return config;
}

TEST(Simulation, AllocatesNothingInAnIteration) {
  Simulation simulation(config_of(court({{"extra_balls", "3"}})));
  std::vector<BallTarget>& balls = simulation.balls()->targets();
  for (BallTarget& ball : balls) ball = {{{0, 0.3, 1.3}, {0, -4, 0}}, true};
  simulation.advance();
  for (BallTarget& ball : balls) ball.imposed = false;

  const std::size_t before = allocations;
  for (int i = 2; i < 600; ++i) simulation.advance();
  simulation.snapshot(0);
  simulation.restore(0);
  simulation.reset();
  EXPECT_EQ(allocations, before);
}

TEST(Simulation, HasBallsOnlyIfTheOptionsNameSome) {
  EXPECT_EQ(Simulation(config_of(pendulum())).balls(), nullptr);
  Simulation simulation(config_of(court({{"extra_balls", "3"}})));
  ASSERT_NE(simulation.balls(), nullptr);
  EXPECT_EQ(simulation.balls()->size(), 4u);
}

TEST(Simulation, LeavesTheEngineOutWhereItHasNothingToIntegrate) {
  EXPECT_FALSE(Simulation(config_of(court())).integrates());
  EXPECT_TRUE(Simulation(config_of(court({{"joints", "joint_1"}}))).integrates());
  EXPECT_TRUE(Simulation(config_of(pendulum())).integrates());
}

// the pass that computes the sensors of a row is the first half of the next step
TEST(Simulation, StepsWithSensorsAreThoseOfAPlainLoop) {
  for (const std::string integrator : {"Euler", "implicit", "implicitfast", "RK4"})
    for (const std::string sensor : {"", "<accelerometer site='tip'/>",
                                     "<velocimeter site='tip' nsample='5' delay='.006'/>"}) {
      const std::string file = testing::TempDir() + "/o80_sensors_" + integrator + ".xml";
      std::ofstream(file) << "<mujoco><option integrator='" << integrator << "'/><worldbody>"
                          << "<geom name='floor' type='plane' size='1 1 1'/>"
                          << "<body pos='0 0 .4'><joint name='hinge' axis='0 1 0'/>"
                          << "<geom name='link' type='capsule' size='.03' fromto='0 0 0 .4 0 0'/>"
                          << "<site name='tip' pos='.4 0 0'/></body>"
                          << "<body name='box' pos='.3 0 .1'><freejoint/>"
                          << "<geom name='cube' type='box' size='.05 .05 .05'/></body></worldbody>"
                          << "<actuator><motor joint='hinge'/></actuator>"
                          << "<sensor><framepos objtype='body' objname='box'/>"
                          << "<subtreelinvel body='box'/><subtreeangmom body='box'/>"
                          << "<e_potential/><e_kinetic/>" << sensor << "</sensor></mujoco>";
      Simulation simulation(config_of({{"model", file}, {"mode", "control"}}));
      simulation.steps(2);
      std::filesystem::remove(file);
      const mjModel* model = simulation.model().model.get();
      const DataPointer plain(mj_makeData(model));
      mj_forward(model, plain.get());
      for (int i = 0; i < 500; ++i) {
        simulation.targets().controls[0] = plain->ctrl[0] = 3 * std::sin(0.05 * i);
        simulation.advance();
        for (int step = 0; step < 2; ++step) mj_step(model, plain.get());
        mj_forward(model, plain.get());
        const mjData& data = simulation.data();
        const auto equal = [](const mjtNum* one, const mjtNum* other, mjtSize count) {
          return std::equal(one, one + count, other);
        };
        ASSERT_TRUE(equal(data.qpos, plain->qpos, model->nq)) << integrator << " " << i;
        ASSERT_TRUE(equal(data.qvel, plain->qvel, model->nv)) << integrator << " " << i;
        ASSERT_TRUE(equal(data.sensordata, plain->sensordata, model->nsensordata)) << i;
      }
      EXPECT_GT(simulation.engine_contacts(), 0u);
    }
}

TEST(Simulation, HasNoSnapshotsOfBodiesThatSleep) {
  const std::string file = testing::TempDir() + "/o80_sleep.xml";
  std::ofstream(file) << "<mujoco><option><flag sleep='enable'/></option></mujoco>";
  EXPECT_THROW(Simulation(config_of({{"model", file}})), DriverError);
  EXPECT_EQ(Simulation(config_of({{"model", file}, {"slots", "0"}})).slots(), 0u);
  std::filesystem::remove(file);
}

TEST(Simulation, SharesItsModelWithEqualOnesOnly) {
  const auto model_of = [](const Simulation& simulation) { return simulation.model().model.get(); };
  const Simulation one(config_of(court()));
  const Simulation copy(config_of(court()));
  const Simulation slower(config_of(court({{"timestep", "0.004"}})));
  const Simulation more(config_of(court({{"extra_balls", "1"}})));
  EXPECT_EQ(model_of(copy), model_of(one));
  EXPECT_NE(model_of(slower), model_of(one));
  EXPECT_NE(model_of(more), model_of(one));
  EXPECT_EQ(slower.timestep(), 0.004);
}

TEST(Simulation, SharesItsModelWithCopiesThatTakeTheSameStep) {
  Simulation one(config_of(court()));
  one.steps(3, 0.005);
  Simulation copy(config_of(court()));
  copy.steps(3, 0.005);
  EXPECT_EQ(copy.model().model, one.model().model);
  EXPECT_EQ(copy.model().mjcf, one.model().mjcf);
  EXPECT_DOUBLE_EQ(copy.timestep(), 0.005 / 3);
  copy.steps(2, 0.005);
  EXPECT_DOUBLE_EQ(copy.timestep(), 0.0025);
  EXPECT_DOUBLE_EQ(one.timestep(), 0.005 / 3);
}

TEST(Simulation, DeletesAModelWithItsLastUser) {
  std::weak_ptr<const mjModel> model;
  {
    const Simulation one(config_of(court()));
    {
      Simulation copy(config_of(court()));
      model = copy.model().model;
      copy.steps(3, 0.005);
    }
    EXPECT_FALSE(model.expired());
  }
  EXPECT_TRUE(model.expired());
}

}  // namespace
}  // namespace o80::mujoco
