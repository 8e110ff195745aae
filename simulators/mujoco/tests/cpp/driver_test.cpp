#include "driver/driver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "scenes.hpp"

namespace o80::mujoco {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::HasSubstr;
using testing::Pointwise;
using testing::ThrowsMessage;

using DriverTest = SceneTest;

TEST_F(DriverTest, NamesJointsAndBallsAsTheModelDoes) {
  Inline robot(court({{"extra_balls", "2"}}));

  EXPECT_EQ(robot.at("joint_1"), 0u);
  EXPECT_EQ(robot.at("joint_4"), 3u);
  EXPECT_EQ(robot.at("ball"), 4u);
  EXPECT_EQ(robot.at("ball_2"), 6u);
  const Schema& schema = robot.frontend.schema();
  EXPECT_EQ(schema.groups[0].name.view(), "joints");
  EXPECT_EQ(schema.groups[1].name.view(), "balls");
  EXPECT_EQ(robot.latest().sensor("contacts").rows, 3u);
}

TEST_F(DriverTest, DescribesItsModelForViewers) {
  Inline robot(court({{"extra_balls", "2"}}));

  const ShownModel& shown = robot.frontend.schema().shown;
  EXPECT_THAT(shown.mjcf, AllOf(HasSubstr("<mujoco"), HasSubstr("ball_2")));
  EXPECT_TRUE(std::filesystem::path(shown.file).is_absolute());
  ASSERT_EQ(shown.values.size(), 7u);
  EXPECT_EQ(shown.values[3].name.view(), "joint_4");
  EXPECT_EQ(shown.values[6].name.view(), "ball_2");
  EXPECT_EQ(shown.values[6].what, Shown::position);
}

TEST_F(DriverTest, ImposedJointsAreWhereTheyAreAskedToBeBitForBit) {
  Inline robot(court());
  for (int i = 0; i < 200; ++i) {
    const double t = 0.002 * i;
    for (std::size_t j = 0; j < 4; ++j) {
      const double w = 3.0 + static_cast<double>(j);
      robot.ask("joint_" + std::to_string(j + 1),
                JointState{std::sin(w * t) / 3, w * std::cos(w * t) / 3});
    }
    const Seen seen = robot.burst(1);
    for (std::uint32_t j = 0; j < 4; ++j) {
      const auto observed = seen.observed<JointState>(j);
      const auto desired = seen.desired<JointState>(j);
      ASSERT_EQ(observed.position, desired.position);
      ASSERT_EQ(observed.velocity, desired.velocity);
    }
    ASSERT_EQ(seen.desired<JointState>(0).position, std::sin(3.0 * t) / 3);
  }
}

TEST_F(DriverTest, ThePaddleMovesAsTheJointsSay) {
  Inline robot(court());
  const auto posture = [](double t) {
    return std::array<double, 4>{0.3 * std::sin(4 * t), 0.5 + t, 0.2 - t, std::cos(5 * t)};
  };
  const auto speeds = [](double t) {
    return std::array<double, 4>{1.2 * std::cos(4 * t), 1, -1, -5 * std::sin(5 * t)};
  };
  std::array<Seen, 3> seen{robot.latest(), robot.latest(), robot.latest()};
  for (int i = 0; i < 30; ++i) {
    pose_arm(robot, posture(0.002 * i), speeds(0.002 * i));
    seen = {seen[1], seen[2], robot.burst(1)};
  }
  const Vector difference = (1 / 0.004) * (vector(seen[2].extended<Numbers>("paddle_position")) -
                                           vector(seen[0].extended<Numbers>("paddle_position")));
  EXPECT_THAT(seen[1].extended<Numbers>("paddle_velocity"),
              Pointwise(DoubleNear(1e-4), numbers(difference)));
}

TEST_F(DriverTest, ResetGoesBackToTheStart) {
  Inline robot(court());
  const Row start = robot.rows(1).front();
  const Shot shot = shot_at_the_paddle(robot);
  for (int i = 0; i < 60; ++i) robot.ask("ball", shot.at(i));
  robot.burst(50);
  robot.request(Reset{.seed = 4});
  robot.burst(1);

  EXPECT_TRUE(robot.rows(2).front() == start);
}

void play(Inline& robot, const Shot& shot, int from) {
  for (int i = from; i < from + 60; ++i) {
    pose_arm(robot, {0.1 + 0.001 * i, 0.9, 0.4, -0.2}, {0.5, 0, 0, 0});
    robot.ask("ball", shot.at(i));
    robot.ask("ball_1", shot.at(i / 2));
  }
}

TEST_F(DriverTest, RepeatsBitForBitAfterARestore) {
  Inline robot(court({{"extra_balls", "1"}, {"steps", "4"}, {"timestep", "0.0005"}}));
  const Shot shot = shot_at_the_paddle(robot);
  play(robot, shot, 0);
  robot.burst(15);  // before the hit
  robot.request(Snapshot{.slot = 1});
  robot.request(Restore{.slot = 1});
  play(robot, shot, 15);
  ASSERT_GE(robot.burst(400).paddle().count, 1u);
  const auto once = robot.rows(401);

  robot.request(Reset{});
  play(robot, shot, 7);
  robot.burst(33);
  robot.request(Restore{.slot = 1});
  play(robot, shot, 15);
  robot.burst(400);

  EXPECT_TRUE(robot.rows(401) == once);
}

TEST_F(DriverTest, GoesOnFromTheDesiredStatesOfASnapshot) {
  Inline robot(court());
  pose_arm(robot, kPosture);
  robot.burst(1);
  robot.request(Snapshot{});
  pose_arm(robot, {});
  robot.burst(1);
  robot.request(Restore{});
  const Seen seen = robot.burst(3);

  for (std::uint32_t j = 0; j < 4; ++j) {
    EXPECT_EQ(seen.desired<JointState>(j).position, kPosture[j]);
    EXPECT_EQ(seen.observed<JointState>(j).position, kPosture[j]);
  }
}

TEST_F(DriverTest, StepsOfTheSimulatorShareAnIteration) {
  Inline coarse(court());
  Inline fine(court({{"steps", "4"}, {"timestep", "0.0005"}}));
  std::array<WatchedContacts, 2> records;
  for (std::size_t n = 0; n < 2; ++n) {
    Inline& robot = n == 0 ? coarse : fine;
    const Shot shot = shot_at_the_paddle(robot);
    for (int i = 0; i < 60; ++i) robot.ask("ball", shot.at(i));
    records[n] = robot.burst(60).paddle();
  }
  EXPECT_EQ(records[0].iteration, records[1].iteration);
  EXPECT_NEAR(records[0].fraction, records[1].fraction, 1e-6);
  EXPECT_THAT(records[0].position, Pointwise(DoubleNear(1e-8), records[1].position));
}

TEST_F(DriverTest, AnswersWrongNamesWithTheNamesOfTheModel) {
  const auto start = [](const OptionValues& options) { return [=] { Inline robot(options); }; };
  EXPECT_THAT(start(court({{"joints", "elbow"}})),
              ThrowsMessage<Error>(AllOf(HasSubstr("no joint 'elbow'"), HasSubstr("joint_1"))));
  EXPECT_THAT(start(court({{"keyframe", "home"}})),
              ThrowsMessage<Error>(HasSubstr("no keyframe 'home'; there are none")));
  EXPECT_THAT(start({{"model", "nowhere.xml"}}), ThrowsMessage<Error>(HasSubstr("nowhere.xml")));
  EXPECT_THAT(start({}), ThrowsMessage<Error>(HasSubstr("model=PATH")));
}

TEST_F(DriverTest, RefusesATimestepThatIsNone) {
  for (const char* text : {"-0.001", "nan", "inf"}) {
    EXPECT_THAT([&] { Inline robot(court({{"timestep", text}})); },
                ThrowsMessage<Error>(HasSubstr("timestep must be finite and positive")));
  }
}

TEST_F(DriverTest, AnyModelRunsWithItsJointsImposedAndTheRestAsPhysicsSays) {
  Inline robot(pendulum({{"mode", "imposed"}}));
  robot.ask("hinge", JointState{0.5, 0});
  const Seen seen = robot.burst(500);

  EXPECT_EQ(seen.observed<JointState>(0).position, 0.5);
  EXPECT_EQ(seen.extended<double>("angle"), 0.5);
  // the box has settled on the floor
  EXPECT_NEAR(seen.extended<Numbers>("box_position")[2], 0.1, 0.002);
  EXPECT_GE(seen.extended<std::uint32_t>("engine_contacts"), 4u);
}

TEST_F(DriverTest, ControlsDriveTheModelsOwnActuatorsWithinTheirRange) {
  Inline robot(pendulum());

  EXPECT_THAT([&] { robot.ask("motor", 3.0); }, ThrowsMessage<Error>(HasSubstr("2")));
  robot.ask("motor", 1.5);
  const Seen seen = robot.burst(100);
  EXPECT_EQ(seen.observed<double>(0), 1.5);
  EXPECT_GT(std::abs(seen.extended<JointState>("joints").position), 0.01);
  EXPECT_EQ(seen.extended<JointState>("joints").position, seen.extended<double>("angle"));
}

TEST_F(DriverTest, ADivergedSimulationIsAFault) {
  // the engine's own state is broken, which no command can do
  const std::string broken = R"(
<mujoco>
  <option timestep="0.002"/>
  <worldbody><body><joint name="slide" type="slide" stiffness="-1e12"/>
  <geom size="0.1" mass="1e-6"/></body></worldbody>
  <actuator><motor name="motor" joint="slide"/></actuator>
</mujoco>)";
  const auto here = std::filesystem::current_path();
  std::filesystem::current_path(directory_.path());  // the engine writes a log where it runs
  Inline wild({{"model", file("broken.xml", broken)}, {"mode", "control"}});
  wild.ask("motor", 1e6);
  EXPECT_THAT([&] { wild.burst(1000); }, ThrowsMessage<Error>(HasSubstr("diverged")));
  std::filesystem::current_path(here);
}

}  // namespace
}  // namespace o80::mujoco
