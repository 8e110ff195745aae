#include "o80/control/clamp.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "control/rig.hpp"

namespace o80::test {
namespace {

using testing::ElementsAre;

TEST(Clamp, TargetsOutsideTheBoundsStopAtThemAndTheRowSaysSo) {
  Schema schema = plain_robot(2);
  schema.actuator(0).limits({.minimum = -1.0, .maximum = 2.5});
  Rig rig(schema);
  rig.add(0, over(4), {4.0});
  rig.add(1, over(4), {4.0});
  const CommandId batch = rig.pulse();
  std::vector<bool> clamped;
  for (int i = 0; i < 4; ++i) {
    rig.step();
    clamped.push_back(rig.clamped(0));
    EXPECT_FALSE(rig.clamped(1));
  }
  EXPECT_EQ(rig.desired(0), 2.5);
  EXPECT_EQ(rig.desired(1), 4.0);
  EXPECT_THAT(clamped, ElementsAre(false, false, true, true));
  EXPECT_EQ(rig.witness.last(batch + 2).status, Status::limited);
  EXPECT_EQ(rig.witness.last(batch + 2).reason, Reason::limits);
  EXPECT_EQ(rig.witness.last(batch + 3).status, Status::completed);
  rig.step();
  EXPECT_FALSE(rig.clamped(0)) << "an idle actuator is not clamped";
  EXPECT_EQ(rig.desired(0), 2.5);
}

TEST(Clamp, TheNextCommandStartsFromTheClampedState) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits({.maximum = 2.0});
  Rig rig(schema);
  rig.add(0, direct(), {4.0});
  rig.add(0, over(2), {0.0});
  rig.pulse();
  EXPECT_THAT(rig.run(3), ElementsAre(2.0, 1.0, 0.0));
}

TEST(Clamp, NothingMovesFasterThanItsSpeed) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits({.speed = 500.0});  // half a unit an iteration
  Rig rig(schema);
  rig.add(0, over(2), {2.0});
  rig.add(0, over(2), {1.5});
  const CommandId batch = rig.pulse();
  EXPECT_THAT(rig.run(4), ElementsAre(0.5, 1.0, 1.25, 1.5));
  EXPECT_EQ(rig.witness.status(batch + 2), Status::limited);
  EXPECT_EQ(rig.witness.status(batch + 3), Status::completed);
}

TEST(Clamp, ACommandClampedOnlyOnItsWayIsCompleted) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits({.maximum = 10.0});
  Rig rig(schema);
  rig.add(0, over(10), {10.0});
  rig.pulse();
  rig.run(9);
  rig.add(0, overwriting(smoothly(over(20))), {9.5});  // overshoots 10 on its way
  const CommandId batch = rig.pulse();
  bool clamped = false;
  for (int i = 0; i < 20; ++i) {
    rig.step();
    clamped = clamped || rig.clamped();
    EXPECT_LE(rig.desired(), 10.0);
  }
  EXPECT_TRUE(clamped);
  EXPECT_EQ(rig.witness.status(batch + 2), Status::completed);
}

TEST(Clamp, BoundsComeBeforeTheSpeed) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits({.minimum = 0.0, .maximum = 1.0, .speed = 500.0});
  Rig rig(schema);
  rig.observe(0, 5.0);  // it starts outside
  rig.controller.restart(rig.observed.data(), nullptr, 0);
  rig.add(0, direct(), {9.0});
  rig.pulse();
  EXPECT_THAT(rig.run(1), ElementsAre(4.5)) << "to the bound, as fast as it may";
}

TEST(Clamp, ASpeedPaceAtTheMaximumIsNotClampedByRounding) {
  for (const double speed : {0.1, 0.3, 1.0 / 3.0, 0.7, 12.34567}) {
    for (const bool smooth : {false, true}) {
      constexpr double kFar = 1e6 / 7.0;  // where a number is rounded more than its steps are
      Schema schema = plain_robot(1);
      schema.actuator(0).limits({.speed = speed});
      Rig rig(schema);
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

TEST(Clamp, EachNumberHasItsOwnLimits) {
  Schema schema = plain_robot(1, 2);
  schema.actuator(0).limits("x1", {.minimum = -0.5, .maximum = 0.5});
  Rig rig(schema);
  rig.add(0, direct(), {9.0, 9.0});
  rig.pulse();
  rig.step();
  EXPECT_EQ(rig.desired(0), 9.0);
  EXPECT_EQ(rig.desired(1), 0.5);
}

TEST(Clamp, IntegersAndFloatsStayInsideTheirLimits) {
  Schema schema;
  schema.head.period = kMillisecond;
  const auto type = schema.add_type(
      "State", {scalar_field("i32", Kind::int32), scalar_field("f32", Kind::float32),
                scalar_field("flag", Kind::boolean)});
  schema.add_actuators("joint", type, 1);
  schema.actuator(0).limits("i32", {.minimum = -3.5, .maximum = 3.5, .speed = 100.0});
  schema.actuator(0).limits("f32", {.maximum = 0.1});
  schema.actuator(0).limits("flag", {.maximum = 0.0});
  Rig rig(schema);
  struct {
    std::int32_t i32 = 100;
    float f32 = 1.0F;
    bool flag = true;
  } target;
  std::vector<std::byte> bytes(12);
  std::memcpy(bytes.data(), &target.i32, 4);
  std::memcpy(bytes.data() + 4, &target.f32, 4);
  bytes[8] = std::byte{1};
  for (int i = 0; i < 4; ++i) rig.batch.command(direct(), bytes);
  rig.pulse();
  for (const std::int32_t expected : {1, 2, 3, 3}) {
    rig.step();
    EXPECT_EQ(rig.desired_as<std::int32_t>(0), expected) << "one at a time at least";
    EXPECT_LE(static_cast<double>(rig.desired_as<float>(4)), 0.1);
    EXPECT_NEAR(rig.desired_as<float>(4), 0.1, 1e-7);
    EXPECT_EQ(rig.desired_as<std::uint8_t>(8), 1) << "a boolean has no limits";
  }
}

}  // namespace
}  // namespace o80::test
