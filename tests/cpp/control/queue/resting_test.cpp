// A field that rests, a velocity or a torque, does not keep its last value when no command is left
// (docs/commands.md#with-no-command-left).
#include <gtest/gtest.h>

#include <cmath>

#include "control/rig.hpp"

namespace o80::test {
namespace {

constexpr std::uint32_t kVelocity = 1;

/// A joint of a position and a velocity that rests at `rest`.
Schema joint(double rest, const Limits& of_velocity = {}) {
  FieldRow velocity = scalar_field("velocity", Kind::float64);
  velocity.resting = 1;
  velocity.rest = rest;
  Schema schema = robot_of({scalar_field("position", Kind::float64), velocity});
  schema.actuator(0).limits("velocity", of_velocity);
  return schema;
}

TEST(Resting, ASuccessorGoesOnFromWhatADirectCommandAsked) {
  Rig rig(joint(0.0));
  rig.add(0, direct(), {0.0, 4.0});
  rig.pulse();
  rig.run(3);
  rig.add(0, over(4), {0.0, 8.0});
  rig.pulse();
  rig.step();
  EXPECT_EQ(rig.desired(kVelocity), 5.0);
}

// rule C19
TEST(Resting, AFieldThatACommandDoesNotNameGoesToRestWhileItRuns) {
  const std::vector<std::uint64_t> position_only = {1};
  RecordHead partial = over(100);
  partial.masked = 1;
  RecordHead partial_direct = direct();
  partial_direct.masked = 1;
  for (const RecordHead& successor : {partial, partial_direct}) {
    for (const RecordHead& first : {over(3), direct()}) {
      for (const Mode mode : {Mode::queue, Mode::overwrite}) {
        Rig rig(joint(0.5, {.speed = 1000.0}));
        rig.add(0, first, {1.0, 2.0});
        rig.pulse();
        rig.run(3);
        ASSERT_GT(rig.desired(kVelocity), 0.9);
        RecordHead next = successor;
        next.mode = mode;
        rig.add_rows(0, next, 1, {3.0, 0.0}, {}, position_only);
        rig.pulse();
        rig.run(5);
        EXPECT_EQ(rig.desired(kVelocity), 0.5);
      }
    }
  }
}

TEST(Resting, ADirectValueOfAnotherThatLeavesItOutEndsIt) {
  Rig rig(joint(0.0));
  rig.add(0, direct(), {1.0, 2.0});
  rig.pulse(0);
  rig.run(3);
  EXPECT_TRUE(rig.controller.acts(0));
  RecordHead head = direct();
  head.masked = 1;
  rig.add_rows(0, head, 1, {3.0, 0.0}, {}, {1});
  rig.pulse(1);
  rig.run(2);
  EXPECT_EQ(rig.desired(), 3.0);
  EXPECT_EQ(rig.desired(kVelocity), 0.0);
  EXPECT_FALSE(rig.controller.acts(0));
  EXPECT_FALSE(rig.controller.acts(1));
}

TEST(Resting, ZeroIsPositiveWhateverWasCommandedOrObserved) {
  for (const RecordHead& head : {direct(), over(3), paced(Pace::fastest, 0)}) {
    Rig rig(joint(0.0, {.speed = 1000.0, .acceleration = 1e6}));
    rig.observe(0, -0.0);
    rig.observe(8 * kVelocity, -0.0);
    rig.controller.restart(rig.observed.data(), nullptr, rig.next);
    rig.add(0, head, {-0.0, -0.0});
    rig.pulse();
    for (int i = 0; i < 20; ++i) {
      rig.step();
      EXPECT_FALSE(std::signbit(rig.desired())) << i;
      EXPECT_FALSE(std::signbit(rig.desired(kVelocity))) << i;
    }
  }
}

TEST(Resting, OfInterruptedCommandsWhileAllFollowTheFieldGoesOnAndTheOthersBeginAtTheReading) {
  Rig rig(joint(0.0, {.speed = 1000.0}));
  rig.controller.restart(rig.observed.data(), nullptr, rig.next, true);
  double velocity = 0.0;
  for (int i = 0; i <= 3; ++i) {
    rig.observe(0, 10.0 * i);
    rig.add(0, over(10), {0.0, 10.0});
    rig.pulse();
    rig.step();
    EXPECT_DOUBLE_EQ(rig.desired(), 9.0 * i);
    EXPECT_GT(rig.desired(kVelocity), velocity);
    EXPECT_LE(rig.desired(kVelocity), velocity + 1.0);
    velocity = rig.desired(kVelocity);
    rig.controller.interrupt(0, rig.next - 1);
  }
  rig.step();
  EXPECT_EQ(rig.desired(), 30.0);
  EXPECT_DOUBLE_EQ(rig.desired(kVelocity), velocity - 1.0);
}

TEST(Resting, OfAnActuatorThatFollowsTheFieldRestsAndTheOthersFollow) {
  Schema schema = joint(0.0, {.speed = 1000.0});
  schema.actuator(0).when_idle(WhenIdle::follow);
  Rig rig(schema);
  rig.observe(0, 0.25);
  rig.observe(8, 7.0);
  rig.add(0, over(3), {1.0, 2.0});
  rig.pulse();
  rig.run(3);
  EXPECT_EQ(rig.desired(kVelocity), 2.0);
  rig.step();
  EXPECT_EQ(rig.desired(kVelocity), 1.0) << "on its way at 1000/s";
  EXPECT_TRUE(rig.controller.braking());
  EXPECT_EQ(rig.desired(), 0.25);
  rig.run(3);
  EXPECT_EQ(rig.desired(kVelocity), 0.0);
  EXPECT_FALSE(rig.controller.braking());

  rig.add(0, direct(), {1.0, 1.0});
  rig.pulse();
  rig.run(10);
  EXPECT_EQ(rig.desired(kVelocity), 1.0) << "a direct value stays";
  EXPECT_TRUE(rig.controller.acts(0));
  rig.controller.halt(rig.next);
  rig.run(3);
  EXPECT_EQ(rig.desired(kVelocity), 0.0);
  EXPECT_EQ(rig.desired(), 0.25);
}

}  // namespace
}  // namespace o80::test
