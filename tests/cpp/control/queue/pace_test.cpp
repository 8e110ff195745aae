// Paces of integers, of types that blend, and of commands without their first field (rule C7).
#include <gtest/gtest.h>

#include "control/rig.hpp"

namespace o80::test {
namespace {

template <class T>
void expect_ten_in_a_second(Kind kind) {
  Schema counter = robot_of({scalar_field("", kind)});
  counter.actuator(0).limits({.speed = 10.0});
  Rig rig(std::move(counter));
  RecordHead head = direct();
  rig.batch.command(head, bytes_of_one(T{100}));
  rig.pulse();
  rig.step();
  EXPECT_EQ(rig.witness.last(rig.sent + 2).status, Status::active) << "it goes on";
  // asked again and again, as a stream of direct commands does
  for (int i = 1; i < 1000; ++i) {
    rig.batch.command(overwriting(head), bytes_of_one(T{100}));
    rig.pulse();
    rig.step();
    ASSERT_LE(static_cast<double>(rig.desired_as<T>(0)), 10e-3 * (i + 1) + 0.5) << i;
  }
  EXPECT_EQ(rig.desired_as<T>(0), T{10}) << "and it gets somewhere";
}

void blend_both(void* out, const void* from, const void* to, double share) {
  for (int i = 0; i < 2; ++i) {
    const double begin = static_cast<const double*>(from)[i];
    static_cast<double*>(out)[i] = begin + share * (static_cast<const double*>(to)[i] - begin);
  }
}

TEST(Pace, AStateThatBlendsByItselfGoesFromItsBeginToItsTarget) {
  Schema schema = plain_robot(1, 2);
  schema.hooks[0].blend = blend_both;
  Rig rig(std::move(schema));
  for (const std::vector<double>& target : {std::vector{1.0, -2.0}, std::vector{4.0, 2.0}}) {
    const std::array begin{rig.desired(0), rig.desired(1)};
    rig.add(0, over(8), target);
    rig.pulse();
    for (int i = 1; i <= 8; ++i) {
      rig.step();
      EXPECT_DOUBLE_EQ(rig.desired(0), begin[0] + i / 8.0 * (target[0] - begin[0])) << i;
      EXPECT_DOUBLE_EQ(rig.desired(1), begin[1] + i / 8.0 * (target[1] - begin[1])) << i;
    }
  }
}

TEST(Pace, TheSpeedLimitOfAnIntegerIsKept) {
  expect_ten_in_a_second<std::int8_t>(Kind::int8);
  expect_ten_in_a_second<std::uint16_t>(Kind::uint16);
  expect_ten_in_a_second<std::int32_t>(Kind::int32);
  expect_ten_in_a_second<std::int64_t>(Kind::int64);
}

// rule C7
TEST(Pace, ASpeedIsThatOfTheFirstNumberTheCommandNames) {
  for (const bool smooth : {false, true}) {
    Rig rig(plain_robot(1, 2));
    RecordHead head = at_speed(1.0);
    if (smooth) head = smoothly(head);
    rig.add_rows(0, head, 1, {99.0, 0.5}, {}, {0b10});
    const CommandId batch = rig.pulse();
    double before = 0.0;
    for (int i = 0; i < 2000 && rig.controller.active(); ++i) {
      rig.step();
      ASSERT_LE(rig.desired(1) - before, 1e-3 * (1.0 + 1e-9));
      before = rig.desired(1);
    }
    EXPECT_EQ(rig.desired(1), 0.5);
    EXPECT_EQ(rig.desired(0), 0.0);
    const StatusChange end = rig.witness.last(batch + 2);
    EXPECT_EQ(end.status, Status::completed);
    EXPECT_EQ(end.iteration, smooth ? 936 : 500);
  }
}

TEST(Pace, AMotionThatIsTurnedBackIsNoFasterThanItsSpeed) {
  for (const bool limited : {false, true}) {
    Schema schema = plain_robot(1);
    if (limited) schema.actuator(0).limits({.speed = 5000, .acceleration = 400'000, .jerk = 2e8});
    Rig rig(schema);
    rig.add(0, smoothly(over(10)), {20.0});
    rig.pulse();
    double before = rig.run(5).back();
    rig.add(0, overwriting(smoothly(at_speed(227.0))), {before - 3.5});
    const CommandId batch = rig.pulse();
    for (int i = 0; i < 500 && rig.controller.active(); ++i) {
      rig.step();
      ASSERT_GE(rig.desired() - before, -0.227 * (1.0 + 1e-9)) << limited << ' ' << i;
      before = rig.desired();
    }
    EXPECT_EQ(rig.witness.status(batch + 2), Status::completed) << limited;
  }
}

TEST(Pace, ACommandThatWouldTakeTooLongMovesNothing) {
  Rig rig(plain_robot(1, 2));
  rig.observe(8, 100.0);
  rig.add_rows(0, from_observed(at_speed(1e-9)), 2, {1e9, 5.0, 2e9, 6.0});
  const CommandId batch = rig.pulse();
  rig.step();
  EXPECT_EQ(rig.witness.status(batch + 2), Status::rejected);
  rig.add(0, smoothly(over(10)), {0.0, 1.0});
  rig.pulse();
  for (const double desired : rig.run(10, 1)) {
    EXPECT_GE(desired, 0.0);
    EXPECT_LE(desired, 1.0);
  }
}

}  // namespace
}  // namespace o80::test
