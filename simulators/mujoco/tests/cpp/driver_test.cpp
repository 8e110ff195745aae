#include "driver/driver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "count_allocations.hpp"
#include "robot/library.hpp"
#include "table_tennis_scene.hpp"

namespace o80::mujoco {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::HasSubstr;
using testing::Pointwise;
using testing::ThrowsMessage;

constexpr const char* kPendulum = R"(
<mujoco>
  <worldbody>
    <body>
      <joint name="hinge" type="hinge" axis="0 1 0" damping="0.1"/>
      <geom name="bob" type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/>
    </body>
    <body name="box" pos="2 0 0.11"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
    <geom type="plane" size="5 5 1" pos="0 0 0"/>
  </worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-2 2" ctrllimited="true"/></actuator>
  <sensor>
    <jointpos name="angle" joint="hinge"/>
    <framepos name="box_position" objtype="body" objname="box"/>
  </sensor>
</mujoco>)";

TEST_F(MujocoDriverTest, NamesJointsAndBallsAsTheModelDoes) {
  Inline twin(table_tennis({{"extra_balls", "2"}}));

  EXPECT_EQ(twin.at("joint_1"), 0u);
  EXPECT_EQ(twin.at("joint_4"), 3u);
  EXPECT_EQ(twin.at("ball"), 4u);
  EXPECT_EQ(twin.at("ball_2"), 6u);
  const Schema& schema = twin.frontend.schema();
  EXPECT_EQ(schema.groups[0].name.view(), "joints");
  EXPECT_EQ(schema.groups[1].name.view(), "balls");
  EXPECT_EQ(twin.latest().sensor("contacts").rows, 3u);
}

TEST_F(MujocoDriverTest, ImposedJointsAreWhereTheyAreAskedToBeBitForBit) {
  Inline twin(table_tennis());
  for (int i = 0; i < 200; ++i) {
    const double t = 0.002 * i;
    for (std::size_t j = 0; j < 4; ++j) {
      const double w = 3.0 + static_cast<double>(j);
      twin.ask("joint_" + std::to_string(j + 1),
               JointState{std::sin(w * t) / 3, w * std::cos(w * t) / 3});
    }
    const Seen seen = twin.burst(1);
    for (std::uint32_t j = 0; j < 4; ++j) {
      const auto observed = seen.observed<JointState>(j);
      const auto desired = seen.desired<JointState>(j);
      ASSERT_EQ(observed.position, desired.position);
      ASSERT_EQ(observed.velocity, desired.velocity);
    }
    ASSERT_EQ(seen.desired<JointState>(0).position, std::sin(3.0 * t) / 3);
  }
}

TEST_F(MujocoDriverTest, TheRacketMovesAsTheJointsSay) {
  Inline twin(table_tennis());
  const auto posture = [](double t) {
    return std::array<double, 4>{0.3 * std::sin(4 * t), 0.5 + t, 0.2 - t, std::cos(5 * t)};
  };
  const auto speeds = [](double t) {
    return std::array<double, 4>{1.2 * std::cos(4 * t), 1, -1, -5 * std::sin(5 * t)};
  };
  std::array<Seen, 3> seen{twin.latest(), twin.latest(), twin.latest()};
  for (int i = 0; i < 30; ++i) {
    pose_arm(twin, posture(0.002 * i), speeds(0.002 * i));
    seen = {seen[1], seen[2], twin.burst(1)};
  }
  const Vector difference = (1 / 0.004) * (vector(seen[2].extended<Numbers>("racket_position")) -
                                           vector(seen[0].extended<Numbers>("racket_position")));
  EXPECT_THAT(seen[1].extended<Numbers>("racket_velocity"),
              Pointwise(DoubleNear(1e-4), numbers(difference)));
}

TEST_F(MujocoDriverTest, ResetGoesBackToTheStart) {
  Inline twin(table_tennis());
  const Row start = twin.rows(1).front();
  const Shot shot = shot_at_the_racket(twin);
  for (int i = 0; i < 60; ++i) twin.ask("ball", shot.at(i));
  twin.burst(50);
  twin.request(Reset{.seed = 4});
  twin.burst(1);

  EXPECT_TRUE(twin.rows(2).front() == start);
}

void play(Inline& twin, const Shot& shot, int from) {
  for (int i = from; i < from + 60; ++i) {
    pose_arm(twin, {0.1 + 0.001 * i, 0.9, 0.4, -0.2}, {0.5, 0, 0, 0});
    twin.ask("ball", shot.at(i));
    twin.ask("ball_1", shot.at(i / 2));
  }
}

TEST_F(MujocoDriverTest, RepeatsBitForBitAfterARestore) {
  Inline twin(table_tennis({{"extra_balls", "1"}, {"steps", "4"}, {"timestep", "0.0005"}}));
  const Shot shot = shot_at_the_racket(twin);
  play(twin, shot, 0);
  twin.burst(15);  // before the hit
  twin.request(Snapshot{.slot = 1});
  twin.request(Restore{.slot = 1});
  play(twin, shot, 15);
  ASSERT_GE(twin.burst(400).record().count, 1u);
  const auto once = twin.rows(401);

  twin.request(Reset{});
  play(twin, shot, 7);
  twin.burst(33);
  twin.request(Restore{.slot = 1});
  play(twin, shot, 15);
  twin.burst(400);

  EXPECT_TRUE(twin.rows(401) == once);
}

TEST_F(MujocoDriverTest, GoesOnFromTheDesiredStatesOfASnapshot) {
  Inline twin(table_tennis());
  pose_arm(twin, kPosture);
  twin.burst(1);
  twin.request(Snapshot{});
  pose_arm(twin, {});
  twin.burst(1);
  twin.request(Restore{});
  const Seen seen = twin.burst(3);

  for (std::uint32_t j = 0; j < 4; ++j) {
    EXPECT_EQ(seen.desired<JointState>(j).position, kPosture[j]);
    EXPECT_EQ(seen.observed<JointState>(j).position, kPosture[j]);
  }
}

TEST_F(MujocoDriverTest, DoesTheSameInTwoRuns) {
  Inline one(table_tennis({{"extra_balls", "1"}}));
  Inline other(table_tennis({{"extra_balls", "1"}}));
  for (Inline* twin : {&one, &other}) {
    play(*twin, shot_at_the_racket(*twin), 0);
    twin->burst(500);
  }
  EXPECT_TRUE(one.rows(503) == other.rows(503));
}

TEST_F(MujocoDriverTest, StepsOfTheSimulatorShareAnIteration) {
  Inline coarse(table_tennis());
  Inline fine(table_tennis({{"steps", "4"}, {"timestep", "0.0005"}}));
  std::array<BallRecord, 2> records;
  for (std::size_t n = 0; n < 2; ++n) {
    Inline& twin = n == 0 ? coarse : fine;
    const Shot shot = shot_at_the_racket(twin);
    for (int i = 0; i < 60; ++i) twin.ask("ball", shot.at(i));
    records[n] = twin.burst(60).record();
  }
  EXPECT_EQ(records[0].iteration, records[1].iteration);
  EXPECT_NEAR(records[0].fraction, records[1].fraction, 1e-6);
  EXPECT_THAT(records[0].position, Pointwise(DoubleNear(1e-8), records[1].position));
}

TEST_F(MujocoDriverTest, RunsAtThePeriodOfTheModelIfNoOtherIsAskedFor) {
  EXPECT_EQ(Inline(table_tennis(), 0).frontend.period(), 2'000'000);
  EXPECT_EQ(Inline(table_tennis({{"steps", "5"}}), 0).frontend.period(), 10'000'000);
  EXPECT_EQ(Inline(table_tennis({{"timestep", "0.0005"}}), 0).frontend.period(), 500'000);
  // a timestep need not be a whole number of nanoseconds
  Inline odd(table_tennis({{"timestep", "0.00033333333333"}}), 0);
  EXPECT_EQ(odd.frontend.period(), 333'333);
  odd.burst(3);
}

TEST_F(MujocoDriverTest, TakesAsManyStepsAsThePeriodHolds) {
  Inline one_by_one({{"model", file("pendulum.xml", kPendulum)}, {"mode", "control"}}, 2'000'000);
  Inline by_five({{"model", file("pendulum.xml", kPendulum)}, {"mode", "control"}}, 10'000'000);
  for (Inline* robot : {&one_by_one, &by_five}) robot->ask("motor", 1.5);
  const Seen single = one_by_one.burst(200);
  const Seen five = by_five.burst(40);

  EXPECT_EQ(single.extended<JointState>("joints").position,
            five.extended<JointState>("joints").position);
}

TEST_F(MujocoDriverTest, RefusesAPeriodOfNoWholeNumberOfStepsBeforeItStarts) {
  const auto start = [](std::int64_t period, const OptionValues& more) {
    return [=] { Inline twin(table_tennis(more), period); };
  };
  EXPECT_THAT(start(1'000'000, {}),
              ThrowsMessage<Error>(AllOf(HasSubstr("1000 Hz (iterations of 1 ms)"),
                                         HasSubstr("steps of 2 ms"), HasSubstr("Ask for 500 Hz"),
                                         HasSubstr("timestep=0.001 [s]"))));
  EXPECT_THAT(start(5'000'000, {}), ThrowsMessage<Error>(AllOf(
                                        HasSubstr("200 Hz"), HasSubstr("Ask for 250 or 166.667 Hz"),
                                        HasSubstr("timestep=0.00166666667"))));
  EXPECT_THAT(start(2'000'000, {{"steps", "5"}}),
              ThrowsMessage<Error>(AllOf(HasSubstr("5 steps of 2 ms make iterations of 10 ms"),
                                         HasSubstr("Ask for 100 Hz"))));
}

TEST_F(MujocoDriverTest, TheAdviceAboutThePeriodWorks) {
  for (const std::int64_t period : {1'000'000, 5'000'000, 3'333'333, 7'000'001, 400'000}) {
    std::string text;
    try {
      Inline twin(table_tennis(), period);
    } catch (const Error& error) {
      text = error.what();
    }
    const std::size_t at = text.find("timestep=");
    ASSERT_NE(at, std::string::npos) << period << ": " << text;
    const std::string advised = text.substr(at + 9, text.find(' ', at) - at - 9);
    Inline twin(table_tennis({{"timestep", advised}}), period);
    EXPECT_NO_THROW(twin.burst(2)) << text;
    const double rate = std::stod(text.substr(text.find("Ask for ") + 8));
    Inline slower(table_tennis(), std::llround(1e9 / rate));
    EXPECT_NO_THROW(slower.burst(2)) << text;
  }
}

TEST_F(MujocoDriverTest, AnswersWrongNamesWithTheRightOnes) {
  const auto start = [](const OptionValues& options) { return [=] { Inline twin(options); }; };
  EXPECT_THAT(start(table_tennis({{"joints", "elbow"}})),
              ThrowsMessage<Error>(AllOf(HasSubstr("no joint 'elbow'"), HasSubstr("joint_1"))));
  EXPECT_THAT(start(table_tennis({{"balls", "racket"}})),
              ThrowsMessage<Error>(HasSubstr("'racket' is no ball: it needs a free joint")));
  EXPECT_THAT(start(table_tennis({{"racket", "bat"}})),
              ThrowsMessage<Error>(AllOf(HasSubstr("no geom 'bat'"), HasSubstr("racket"))));
  EXPECT_THAT(start({{"model", "nowhere.xml"}}), ThrowsMessage<Error>(HasSubstr("nowhere.xml")));
  EXPECT_THAT(start({}), ThrowsMessage<Error>(HasSubstr("model=PATH")));
}

TEST_F(MujocoDriverTest, AnyModelRunsWithItsJointsImposedAndTheRestAsPhysicsSays) {
  Inline twin({{"model", file("pendulum.xml", kPendulum)}});
  twin.ask("hinge", JointState{0.5, 0});
  const Seen seen = twin.burst(500);

  EXPECT_EQ(seen.observed<JointState>(0).position, 0.5);
  EXPECT_EQ(seen.extended<double>("angle"), 0.5);
  // the box has settled on the floor
  EXPECT_NEAR(seen.extended<Numbers>("box_position")[2], 0.1, 0.002);
  EXPECT_GE(seen.extended<std::uint32_t>("engine_contacts"), 4u);
}

TEST_F(MujocoDriverTest, ControlsDriveTheModelsOwnActuatorsWithinTheirRange) {
  Inline twin({{"model", file("pendulum.xml", kPendulum)}, {"mode", "control"}});

  EXPECT_THAT([&] { twin.ask("motor", 3.0); }, ThrowsMessage<Error>(HasSubstr("2")));
  twin.ask("motor", 1.5);
  const Seen seen = twin.burst(100);
  EXPECT_EQ(seen.observed<double>(0), 1.5);
  EXPECT_GT(std::abs(seen.extended<JointState>("joints").position), 0.01);
  EXPECT_EQ(seen.extended<JointState>("joints").position, seen.extended<double>("angle"));
}

TEST_F(MujocoDriverTest, AModelOfPhysicsRepeatsBitForBitAfterARestore) {
  Inline twin({{"model", file("pendulum.xml", kPendulum)}, {"mode", "control"}});
  twin.ask("motor", 1.5);
  twin.burst(50);
  twin.request(Snapshot{});
  twin.burst(200);
  const auto once = twin.rows(200);
  twin.request(Restore{});
  twin.burst(200);

  EXPECT_TRUE(twin.rows(200) == once);
}

TEST_F(MujocoDriverTest, ADivergedSimulationIsAFault) {
  Inline twin(
      {{"model", file("pendulum.xml", kPendulum)}, {"mode", "control"}, {"timestep", "0.002"}});
  // nothing a frontend may send: the engine's own state is broken
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

TEST_F(MujocoDriverTest, NamesBothVersionsWhenTheLibraryIsAnother) {
  EXPECT_THAT([] { check_version(3'009'000, "3.9.0"); },
              ThrowsMessage<DriverError>(AllOf(HasSubstr("built for MuJoCo 4.0.1"),
                                               HasSubstr("MuJoCo 3.9.0 is loaded"),
                                               HasSubstr("pip install mujoco-core==4.0.1"))));
  EXPECT_NO_THROW(check_version(mj_version(), mj_versionString()));
  EXPECT_STREQ(built_with(), "mujoco 4.0.1");
}

TEST_F(MujocoDriverTest, IsARobotLibraryThatNamesItsMujoco) {
  const RobotLibrary library = RobotLibrary::load(O80_TEST_PREFIX "/lib/o80/robots/mujoco.so");

  EXPECT_STREQ(library.table->name, "mujoco");
  EXPECT_THAT(library.table->built_with, HasSubstr(built_with()));
}

TEST_F(MujocoDriverTest, SaysBothVersionsAndTheCureIfItsMujocoIsNotInstalled) {
  // the robot as if built for another version, laid out as in a wheel
  namespace fs = std::filesystem;
  const fs::path site = directory_.path();
  fs::create_directories(site / "o80/lib/o80/robots");
  fs::create_directories(site / "mujoco");
  std::ofstream(site / "mujoco/libmujoco.so.4.0.1") << "there";
  std::ifstream in(O80_TEST_PREFIX "/lib/o80/robots/mujoco.so", std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const std::string wanted = "libmujoco.so.4.0.1";
  std::size_t replaced = 0;
  for (auto at = bytes.find(wanted); at != std::string::npos; at = bytes.find(wanted, at)) {
    bytes.replace(at, wanted.size(), "libmujoco.so.3.9.0");
    ++replaced;
  }
  ASSERT_GT(replaced, 0u);
  const std::string path = site / "o80/lib/o80/robots/mujoco.so";
  std::ofstream(path, std::ios::binary) << bytes;

  EXPECT_THAT([&] { RobotLibrary::load(path); },
              ThrowsMessage<DriverError>(AllOf(HasSubstr("built for libmujoco.so.3.9.0"),
                                               HasSubstr("installed is libmujoco.so.4.0.1"),
                                               HasSubstr("Install the version it was built for"))));
}

TEST_F(MujocoDriverTest, AllocatesNothingInAnIteration) {
  Config config;
  for (const auto& [name, text] : table_tennis({{"extra_balls", "3"}})) {
    set_option(config, name, text);
  }
  Simulation simulation(config);
  for (BallTarget& ball : simulation.targets().balls) ball = {{{0, 0.3, 1.3}, {0, -4, 0}}, true};
  simulation.advance();
  for (BallTarget& ball : simulation.targets().balls) ball.imposed = false;

  const std::size_t before = allocations;
  for (int i = 2; i < 600; ++i) simulation.advance();
  simulation.snapshot(0);
  simulation.restore(0);
  simulation.reset();
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace o80::mujoco
