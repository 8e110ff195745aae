#include "control/motion/motion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "control/rig.hpp"

namespace o80::test {
namespace {

// rule L4
TEST(Limiter, ATrajectoryGoesOnUntilItsLastRowIsReached) {
  Rig rig(limited_robot({.speed = 1000.0, .acceleration = 10'000.0, .jerk = 1e6}));
  rig.add_rows(0, over(5), 3, {5.0, -5.0, 10.0});
  const CommandId batch = rig.pulse();
  double furthest = 0.0;
  double lowest = 0.0;
  for (int i = 0; i < 1000 && !is_end(rig.witness.status(batch + 2)); ++i) {
    rig.step();
    furthest = std::max(furthest, rig.desired());
    lowest = std::min(lowest, rig.desired());
  }
  EXPECT_EQ(rig.witness.last(batch + 2).status, Status::completed);
  EXPECT_EQ(rig.witness.last(batch + 2).reason, Reason::limits);
  EXPECT_EQ(rig.desired(), 10.0);
  EXPECT_LE(furthest, 10.0);
  EXPECT_GE(lowest, -5.0);
  for (const double position : rig.run(50)) ASSERT_EQ(position, 10.0);
}

TEST(Limiter, AStatusSaysWhichLimitItWas) {
  Schema schema = plain_robot(1, 2);
  schema.actuator(0).limits("x1", {.minimum = -0.5, .maximum = 0.5, .speed = 100.0});
  Rig rig(schema);
  rig.add(0, over(3), {9.0, 0.5});
  const CommandId batch = rig.pulse();
  rig.run(5);
  const StatusChange told = rig.witness.last(batch + 2);
  EXPECT_EQ(told.status, Status::completed);
  EXPECT_EQ(told.reason, Reason::limits);
  EXPECT_EQ(told.detail, (Limited{Limit::speed, 1}.packed()));
}

// rule C8
TEST(Limiter, TheFastestWayIsRefusedForANumberWithoutLimitsOfSpeedAndAcceleration) {
  for (const Limits& limits : {Limits{}, Limits{.speed = 1.0}}) {
    Schema robot = plain_robot(1, 2);
    robot.actuator(0).limits("x0", {.speed = 1.0, .acceleration = 1.0});
    robot.actuator(0).limits("x1", limits);
    Rig rig(robot, 64);
    rig.add(0, overwriting(paced(Pace::fastest, 0)), {0.1, 0.1});
    const CommandId both = rig.pulse();
    rig.step();
    EXPECT_EQ(rig.witness.status(both + 2), Status::rejected);
    // but the number that has them may be commanded alone
    rig.add_rows(0, overwriting(paced(Pace::fastest, 0)), 1, {0.1, 0.0}, {}, {0b01});
    const CommandId one = rig.pulse();
    while (rig.controller.active()) rig.step();
    EXPECT_EQ(rig.witness.status(one + 2), Status::completed);
  }
}

TEST(Limiter, ARestingNumberThatStandsForAMomentGoesOnToItsRest) {
  Schema schema = plain_robot(1);
  schema.actuator(0)
      .limits({.speed = 1500.0, .acceleration = 20'000.0, .jerk = 2e7})
      .rests_at("", 0.0);
  Rig rig(schema);
  rig.observe(0, -2000.0);
  rig.controller.restart(rig.observed.data(), nullptr, 0);
  rig.observe(0, 250.0);  // far ahead: for an instant the limiter slows down for it
  rig.add(0, from_observed(smoothly(at_speed(200'000.0))), {0.0});
  rig.pulse();
  rig.run(5000);
  EXPECT_EQ(rig.desired(), 0.0);
  EXPECT_FALSE(rig.braking());
}

// rule C19
TEST(Limiter, ADirectValueOfARestingNumberStaysUntilSomethingTakesItsPlace) {
  Schema schema = plain_robot(1, 2);
  schema.actuator(0).rests_at("x1", 0.5);
  Rig rig(schema);
  rig.add(0, direct(), {1.0, 2.0});
  rig.pulse(3);
  rig.run(5);
  EXPECT_EQ(rig.desired(1), 2.0);
  EXPECT_FALSE(rig.active());
  EXPECT_TRUE(rig.controller.acts(3));
  EXPECT_FALSE(rig.controller.acts(2));
  rig.controller.purge_lane(2, kEveryActuator, rig.next);
  EXPECT_EQ(rig.run(1, 1)[0], 2.0) << "it is not that lane's";
  rig.controller.purge_lane(3, kEveryActuator, rig.next);
  EXPECT_EQ(rig.run(1, 1)[0], 0.5);
  EXPECT_TRUE(rig.braking()) << "it moved without a command";
  EXPECT_FALSE(rig.controller.acts(3));
  rig.step();
  EXPECT_FALSE(rig.braking());
}

TEST(Limiter, ASpeedPaceAtTheMaximumIsNotClampedByRounding) {
  for (const double speed : {0.1, 0.3, 1.0 / 3.0, 0.7, 12.34567}) {
    for (const bool smooth : {false, true}) {
      constexpr double kFar = 1e6 / 7.0;  // where a number is rounded more than its steps are
      Rig rig(limited_robot({.speed = speed}));
      rig.observe(0, kFar);
      rig.controller.restart(rig.observed.data(), nullptr, 0);
      const RecordHead head = at_speed(speed);
      rig.add(0, smooth ? smoothly(head) : head, {kFar + 0.3});
      const CommandId batch = rig.pulse();
      while (rig.controller.active()) {
        rig.step();
        ASSERT_FALSE(rig.clamped());
      }
      EXPECT_EQ(rig.witness.status(batch + 2), Status::completed);
    }
  }
}

}  // namespace
}  // namespace o80::test
