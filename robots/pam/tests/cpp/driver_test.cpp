#include "pam/driver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "memory/private_directory.hpp"
#include "robot/driver/driver_instance.hpp"
#include "robot/inline_simulation.hpp"

namespace o80::pam {
namespace {

using testing::DoubleNear;
using testing::Each;
using testing::HasSubstr;
using testing::Pointwise;
using testing::ThrowsMessage;

using Row = InlineSimulation::Row;

/// The arm inside this process, with a frontend.
struct InlineArm : InlineSimulation {
  explicit InlineArm(const OptionValues& options = {}, std::int64_t period = kPeriod)
      : InlineSimulation("pam", *robot_table<PamDriver>("pam"), options, period) {}

  Observation<PamDriver> latest() { return Observation<PamDriver>(frontend.latest()); }
  Observation<PamDriver> burst(std::int64_t iterations) {
    return Observation<PamDriver>(InlineSimulation::burst(iterations));
  }
  void ask(const std::string& muscle, double raw, const CommandOptions& options = {}) {
    InlineSimulation::ask(muscle, raw, options);
  }
  void move() {
    ask("agonist_1", 17000, {.pace = iterations(40)});
    ask("antagonist_2", 14000, {.pace = iterations(25), .profile = Profile::minimum_jerk});
    ask("agonist_4", 9000.4);
  }
};

class PamDriverTest : public testing::Test {
 protected:
  PrivateDirectory directory_;
};

TEST_F(PamDriverTest, NamesItsMusclesAndLimitsTheirPressures) {
  InlineArm arm(OptionValues{{"ranges", "real"}});

  EXPECT_EQ(arm.frontend.actuator("agonist_1"), 0u);
  EXPECT_EQ(arm.frontend.actuator("antagonist_4"), 7u);
  EXPECT_THAT([&] { arm.ask("antagonist_4", 22000); }, ThrowsMessage<Error>(HasSubstr("21900")));
  EXPECT_NO_THROW(arm.ask("antagonist_4", 21900));
}

TEST_F(PamDriverTest, HoldsItsStartingPostureWithoutACommand) {
  InlineArm arm;
  const auto start = arm.latest();
  const auto later = arm.burst(500);

  EXPECT_EQ(start.desired(), start.observed());
  EXPECT_EQ(later.desired(), start.desired());
  EXPECT_THAT(later.extended().joint_positions,
              Pointwise(DoubleNear(0.002), start.extended().joint_positions));
  EXPECT_THAT(start.extended().joint_positions, Pointwise(DoubleNear(0.002), kPlayingPosture));
  EXPECT_THAT(later.extended().clipped, Each(false));
}

TEST_F(PamDriverTest, StartsAsThePressuresGivenHoldIt) {
  InlineArm arm(
      OptionValues{{"start_pressures", "18000,18000,18000,18000,18000,18000,18000,18000"}});

  EXPECT_THAT(arm.latest().desired(), Each(18000.0));
  EXPECT_NEAR(arm.latest().extended().joint_positions[0], 0.0, 1e-6);
  EXPECT_NEAR(arm.latest().extended().bars[3], 1.8112, 1e-9);
}

TEST_F(PamDriverTest, ObservesPressuresThatFollowWithTheLagOfTheirMuscles) {
  InlineArm arm;
  const double before = arm.latest().observed()[0];
  arm.ask("agonist_1", before + 1000);
  const auto after = arm.burst(8);  // 16 ms, the lag of the muscles of joint 1

  EXPECT_NEAR(after.observed()[0], before + 1000 * (1 - std::exp(-1.0)), 1.0);
  EXPECT_EQ(after.desired()[0], before + 1000);
  EXPECT_GT(arm.burst(100).extended().joint_positions[0],
            after.extended().joint_positions[0] + 0.01);
}

TEST_F(PamDriverTest, GivesTheMotionOfItsRacket) {
  InlineArm arm;
  arm.move();
  const auto before = arm.burst(30);
  const auto after = arm.burst(1);

  for (std::size_t i = 0; i < 3; ++i) {
    const double moved = after.extended().racket_position[i] - before.extended().racket_position[i];
    const double mean =
        (after.extended().racket_velocity[i] + before.extended().racket_velocity[i]) / 2;
    EXPECT_NEAR(moved / 0.002, mean, 0.02);
  }
}

TEST_F(PamDriverTest, RefusesAnotherFrequencyThanThatOfItsPeriodAndSaysWhatToDo) {
  EXPECT_THAT([] { InlineArm({}, 1'000'000); },
              ThrowsMessage<Error>(testing::AllOf(HasSubstr("1000 Hz was requested"),
                                                  HasSubstr("frequency out, set it to 500"),
                                                  HasSubstr("period=0.001"))));
}

TEST_F(PamDriverTest, RunsAtTheFrequencyOfItsPeriodWhenNoneIsRequested) {
  InlineArm arm(OptionValues{{"period", "0.004"}}, 0);
  const auto before = arm.burst(1);

  EXPECT_EQ(arm.burst(1).time() - before.time(), 4'000'000);
}

TEST_F(PamDriverTest, TellsHowManySlotsThereAre) {
  InlineArm arm(OptionValues{{"slots", "2"}});
  arm.request(Snapshot{.slot = 2});
  arm.request(Restore{.slot = 1});
  Batch batch = arm.frontend.pulse();
  arm.burst(1);

  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_THAT(batch.handle(0).text, HasSubstr("there are 2 slots"));
  EXPECT_EQ(batch.handle(1).status, Status::rejected);
  EXPECT_THAT(batch.handle(1).text, HasSubstr("request it first"));
}

TEST_F(PamDriverTest, TakesAPresetAndSingleNumbersInsteadOfItsOwn) {
  // nothing moves during the dead time of joint 1
  InlineArm identified(OptionValues{{"preset", "identified"}});
  const auto start = identified.latest();
  identified.ask("agonist_1", start.desired()[0] + 1000);
  EXPECT_EQ(identified.burst(20).observed()[0], start.observed()[0]);
  EXPECT_GT(identified.burst(1).observed()[0], start.observed()[0]);
  EXPECT_LT(identified.burst(60).extended().joint_positions[0],
            start.extended().joint_positions[0] - 0.01);
  EXPECT_THAT([&] { identified.ask("antagonist_4", 22000); },
              ThrowsMessage<Error>(HasSubstr("21900")));

  InlineArm prompt(OptionValues{{"preset", "identified"}, {"dead_time", "0,-1,-1,-1"}});
  prompt.ask("agonist_1", start.desired()[0] + 1000);
  EXPECT_GT(prompt.burst(1).observed()[0], start.observed()[0]);

  EXPECT_THAT([] { InlineArm(OptionValues{{"friction", "0,0,-2,0"}}); },
              ThrowsMessage<std::exception>(HasSubstr("friction of joint 3")));
}

class EveryMuscleModel : public PamDriverTest, public testing::WithParamInterface<std::string> {
 protected:
  OptionValues options() const { return {{"muscle", GetParam()}, {"start_noise", "0.01"}}; }
};

TEST_P(EveryMuscleModel, StartsElsewhereWithAnotherSeedAndAlikeWithTheSame) {
  InlineArm arm(options());
  const auto start_with = [&](std::uint64_t seed) {
    arm.request(Reset{.seed = seed});
    arm.burst(20);
    return arm.rows(21);
  };
  const auto with_one = start_with(1);

  EXPECT_FALSE(start_with(2) == with_one);
  EXPECT_TRUE(start_with(1) == with_one);
}

INSTANTIATE_TEST_SUITE_P(Muscles, EveryMuscleModel, testing::Values("linear", "hill"),
                         [](const auto& model) { return model.param; });

}  // namespace
}  // namespace o80::pam
