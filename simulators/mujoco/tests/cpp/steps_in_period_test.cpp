#include "driver/steps_in_period.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "scenes.hpp"

namespace o80::mujoco {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

using StepsInPeriodTest = SceneTest;

TEST_F(StepsInPeriodTest, RunsAtThePeriodOfTheModelIfNoOtherIsAskedFor) {
  EXPECT_EQ(Inline(court(), 0).frontend.period(), 2'000'000);
  EXPECT_EQ(Inline(court({{"steps", "5"}}), 0).frontend.period(), 10'000'000);
  EXPECT_EQ(Inline(court({{"timestep", "0.0005"}}), 0).frontend.period(), 500'000);
  // a timestep need not be a whole number of nanoseconds
  Inline odd(court({{"timestep", "0.00033333333333"}}), 0);
  EXPECT_EQ(odd.frontend.period(), 333'333);
  odd.burst(3);
}

TEST_F(StepsInPeriodTest, TakesAsManyStepsAsThePeriodHolds) {
  Inline one_by_one(pendulum(), 2'000'000);
  Inline by_five(pendulum(), 10'000'000);
  for (Inline* robot : {&one_by_one, &by_five}) robot->ask("motor", 1.5);
  const Seen single = one_by_one.burst(200);
  const Seen five = by_five.burst(40);

  EXPECT_EQ(single.extended<JointState>("joints").position,
            five.extended<JointState>("joints").position);
}

TEST_F(StepsInPeriodTest, RefusesAPeriodOfNoWholeNumberOfStepsBeforeItStarts) {
  const auto start = [](std::int64_t period, const OptionValues& more) {
    return [=] { Inline robot(pendulum(more), period); };
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

TEST_F(StepsInPeriodTest, TheAdviceAboutThePeriodWorks) {
  for (const std::int64_t period : {1'000'000, 5'000'000, 3'333'333, 7'000'001, 400'000}) {
    std::string text;
    try {
      Inline robot(pendulum(), period);
    } catch (const Error& error) {
      text = error.what();
    }
    const std::size_t at = text.find("timestep=");
    ASSERT_NE(at, std::string::npos) << period << ": " << text;
    const std::string advised = text.substr(at + 9, text.find(' ', at) - at - 9);
    Inline robot(pendulum({{"timestep", advised}}), period);
    EXPECT_NO_THROW(robot.burst(2)) << text;
    const double rate = std::stod(text.substr(text.find("Ask for ") + 8));
    Inline slower(pendulum(), std::llround(1e9 / rate));
    EXPECT_NO_THROW(slower.burst(2)) << text;
  }
}

}  // namespace
}  // namespace o80::mujoco
