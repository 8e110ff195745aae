// Paces that were not kept: speeds of integers, a speed without the first field, trajectories with
// times of their own (rules 5 and 10).
#include <gtest/gtest.h>

#include <cmath>

#include "control/rig.hpp"

namespace o80::test {
namespace {

template <class T>
Schema counter(Kind kind, const Limits& limits) {
  Schema schema;
  schema.head.robot = NameText("robot");
  schema.head.period = kMillisecond;
  schema.add_actuators("counter", schema.add_type("Counter", {scalar_field("", kind)}), 1);
  schema.actuator(0).limits(limits);
  return schema;
}

template <class T>
void expect_ten_in_a_second(Kind kind) {
  Rig rig(counter<T>(kind, {.speed = 10.0}));
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

TEST(Pace, TheSpeedLimitOfAnIntegerIsKept) {
  expect_ten_in_a_second<std::int8_t>(Kind::int8);
  expect_ten_in_a_second<std::uint16_t>(Kind::uint16);
  expect_ten_in_a_second<std::int32_t>(Kind::int32);
  expect_ten_in_a_second<std::int64_t>(Kind::int64);
}

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

/// The iteration at which a trajectory of so many rows, evenly over a time, ends.
Iteration end_of_trajectory(std::uint32_t rows, std::int64_t duration) {
  Rig rig(plain_robot(1), 4096);
  std::vector<double> targets;
  std::vector<std::int64_t> times;
  for (std::uint32_t row = 1; row <= rows; ++row) {
    targets.push_back(row);
    times.push_back(duration * row / rows);
  }
  rig.add_rows(0, during(0), rows, targets, times);
  const CommandId batch = rig.pulse();
  for (int i = 0; i < 20'000 && rig.controller.active(); ++i) rig.step();
  EXPECT_EQ(rig.desired(), rows);
  EXPECT_EQ(rig.witness.status(batch + 2), Status::completed);
  return rig.witness.last(batch + 2).iteration;
}

TEST(Pace, ATrajectoryWithTimesOfItsOwnDoesNotDrift) {
  constexpr std::int64_t kSecond = 1000 * kMillisecond;
  EXPECT_EQ(end_of_trajectory(199, kSecond), 1000);
  EXPECT_EQ(end_of_trajectory(10, kSecond), 1000);
  EXPECT_EQ(end_of_trajectory(999, kSecond), 1000);
}

TEST(Pace, RowsCloserThanAnIterationAreNoDebtOfThoseThatFollow) {
  // 199 rows over 1 s: every 10 ms one, and another one 0.1 ms later
  Rig rig(plain_robot(1));
  std::vector<double> targets;
  std::vector<std::int64_t> times;
  for (std::int64_t i = 1; i <= 100; ++i) {
    for (std::int64_t late = 0; late < (i < 100 ? 2 : 1); ++late) {
      targets.push_back(static_cast<double>(i));
      times.push_back(10 * i * kMillisecond + late * kMillisecond / 10);
    }
  }
  rig.add_rows(0, during(0), 199, targets, times);
  const CommandId batch = rig.pulse();
  rig.run(1200);
  EXPECT_EQ(rig.witness.last(batch + 2).iteration, 1000);
}

TEST(Pace, ATrajectoryWithRowsDenserThanIterationsEndsInTime) {
  EXPECT_NEAR(static_cast<double>(end_of_trajectory(2000, 1000 * kMillisecond)), 1000.0, 1.0);
  EXPECT_NEAR(static_cast<double>(end_of_trajectory(100, 10 * kMillisecond)), 10.0, 1.0);
}

TEST(Pace, RowsOfATrajectoryAtTheSameTimeDoNotDelayTheOthers) {
  Rig rig(plain_robot(1));
  const std::int64_t ms = kMillisecond;
  rig.add_rows(0, during(0), 6, {1.0, 2.0, 3.0, 4.0, 5.0, 6.0},
               {2 * ms, 2 * ms, 2 * ms, 2 * ms, 12 * ms, 20 * ms});
  const CommandId batch = rig.pulse();
  rig.run(30);
  EXPECT_NEAR(static_cast<double>(rig.witness.last(batch + 2).iteration), 20.0, 1.0);
}

TEST(Pace, TheExactTimeOfAQueueRunsOnThroughOtherPaces) {
  Rig rig(plain_robot(1));
  // 0.4 ms are lost by each rounding down, unless they are carried on
  for (int i = 0; i < 10; ++i) {
    rig.add(0, during(3'400'000), {1.0 * i});
    rig.add(0, over(2), {0.5});
    rig.add(0, direct(), {0.25});
  }
  const CommandId batch = rig.pulse();
  rig.run(80);
  EXPECT_EQ(rig.witness.last(batch + 2 + 29).iteration, 34 + 20 + 10);
}

TEST(Pace, TheExactTimeOfAQueueStartsAnewAtAnUntil) {
  Rig rig(plain_robot(1));
  rig.add(0, during(3'400'000), {1.0});
  rig.add(0, until(20), {2.0});
  rig.add(0, during(3'400'000), {3.0});
  rig.add(0, during(3'400'000), {4.0});
  const CommandId batch = rig.pulse();
  rig.run(40);
  EXPECT_EQ(rig.witness.last(batch + 4).iteration, 23);
  EXPECT_EQ(rig.witness.last(batch + 5).iteration, 27);
}

}  // namespace
}  // namespace o80::test
