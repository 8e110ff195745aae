#include "control/motion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "control/rig.hpp"

namespace o80::test {
namespace {

using testing::ElementsAre;

std::vector<double> differences(const std::vector<double>& values) {
  std::vector<double> found;
  for (std::size_t i = 1; i < values.size(); ++i) found.push_back(values[i] - values[i - 1]);
  return found;
}

double largest(const std::vector<double>& values) {
  double found = 0.0;
  for (const double value : values) found = std::max(found, std::abs(value));
  return found;
}

std::vector<double> joined(std::vector<double> first, const std::vector<double>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

TEST(Motion, MinimumJerkFollowsItsPolynomialFromRestToRest) {
  Rig rig(plain_robot(1));
  rig.add(0, smoothly(over(4)), {1.0});
  rig.pulse();
  const auto desired = rig.run(4);
  EXPECT_DOUBLE_EQ(desired[0], 0.103515625);
  EXPECT_DOUBLE_EQ(desired[1], 0.5);
  EXPECT_DOUBLE_EQ(desired[2], 0.896484375);
  EXPECT_EQ(desired[3], 1.0);
}

// speed and acceleration of a motion over 1000 iterations, overwritten in its middle
std::vector<double> overwritten(const RecordHead& first, const RecordHead& second) {
  Rig rig(plain_robot(1));
  rig.add(0, first, {1000.0});
  rig.pulse();
  const auto before = rig.run(300);
  rig.add(0, overwriting(second), {-500.0});
  rig.pulse();
  return joined(before, rig.run(1000));
}

TEST(Motion, MinimumJerkContinuesVelocityAndAccelerationOfAMinimumJerkItOverwrites) {
  const auto speed = differences(overwritten(smoothly(over(1000)), smoothly(over(1000))));
  const auto acceleration = differences(speed);
  const auto jerk = differences(acceleration);
  EXPECT_GT(speed[299], 1.0) << "it is in full motion when overwritten";
  // from one iteration to the next: a few per mille of what is usual in this motion
  EXPECT_LT(largest(acceleration), 0.02);
  EXPECT_LT(largest(jerk), 0.0004);
}

TEST(Motion, MinimumJerkContinuesTheVelocityOfALinearMotionItOverwrites) {
  const auto speed = differences(overwritten(over(1000), smoothly(over(1000))));
  EXPECT_NEAR(speed[298], 1.0, 1e-9);
  EXPECT_NEAR(speed[299], 1.0, 0.001);
  EXPECT_LT(largest(differences(speed)), 0.02);
  EXPECT_LT(largest(differences(differences(speed))), 0.0004);
}

TEST(Motion, MinimumJerkContinuesTheVelocityOfATrajectoryOfOneIterationARow) {
  Rig rig(plain_robot(1));
  std::vector<double> rows;
  for (int i = 1; i <= 1000; ++i) rows.push_back(i);
  rig.add_rows(0, over(1), 1000, rows);
  rig.pulse();
  const auto before = rig.run(300);
  rig.add(0, overwriting(smoothly(over(1000))), {-500.0});
  rig.pulse();
  const auto speed = differences(joined(before, rig.run(1000)));
  EXPECT_EQ(speed[298], 1.0);
  EXPECT_NEAR(speed[299], 1.0, 0.001);
  EXPECT_LT(largest(differences(speed)), 0.03) << "within the rows that are looked at ahead";
}

TEST(Motion, ThatContinuationDoesNotComeByItself) {
  // what the two tests above would see if the motion started at rest
  const auto speed = differences(overwritten(smoothly(over(1000)), over(1000)));
  EXPECT_GT(largest(differences(speed)), 1.0);
}

TEST(Motion, ItContinuesThroughSeveralOverwritesInOneIteration) {
  Rig rig(plain_robot(1));
  rig.add(0, over(1000), {1000.0});
  rig.pulse();
  const auto before = rig.run(300);
  for (int i = 0; i < 3; ++i) rig.add(0, overwriting(smoothly(over(1000))), {-500.0});
  rig.pulse();
  rig.add(0, overwriting(smoothly(over(1000))), {-500.0});
  rig.pulse();
  EXPECT_LT(largest(differences(differences(joined(before, rig.run(1000))))), 0.02);
}

// the first step of a minimum jerk over 100 iterations to 1, after something
double first_step_after(void (*something)(Rig&), const Schema& schema = plain_robot(1)) {
  Rig rig(schema);
  something(rig);
  const double before = rig.desired();
  rig.add(0, overwriting(smoothly(over(100))), {before + 1.0});
  rig.pulse();
  rig.step();
  return rig.desired() - before;
}

TEST(Motion, MinimumJerkStartsAtRestAfterAnythingElse) {
  const double at_rest = minimum_jerk(0.01);
  EXPECT_NEAR(first_step_after([](Rig&) {}), at_rest, 1e-12);
  EXPECT_NEAR(first_step_after([](Rig& rig) {  // a direct command, once there was another one
                rig.add(0, over(2), {9.0});
                rig.pulse();
                rig.run(2);
                rig.add_rows(0, direct(), 4, {1.0, 2.0, 3.0, 4.0});
                rig.pulse();
                rig.run(2);
              }),
              at_rest, 1e-12);
  EXPECT_NEAR(first_step_after([](Rig& rig) {  // a completed one
                rig.add(0, over(4), {4.0});
                rig.pulse();
                rig.run(4);
              }),
              at_rest, 1e-12);
  EXPECT_NEAR(first_step_after([](Rig& rig) {  // a purge, then a hold
                rig.add(0, over(8), {4.0});
                rig.pulse();
                rig.run(4);
                rig.batch.purge(0);
                rig.pulse();
              }),
              at_rest, 1e-12);
  EXPECT_NEAR(first_step_after([](Rig& rig) {
                rig.add(0, over(8), {4.0});
                rig.pulse();
                rig.run(4);
                rig.controller.interrupt(0, 4);
              }),
              at_rest, 1e-12);
  Schema limited = plain_robot(1);
  limited.actuator(0).limits({.minimum = -1000.0, .maximum = 2.0});
  EXPECT_NEAR(first_step_after(
                  [](Rig& rig) {  // a clamped one
                    rig.add(0, over(8), {8.0});
                    rig.pulse();
                    rig.run(4);
                    rig.add(0, overwriting(direct()), {0.0});
                    rig.pulse();
                    rig.run(1);
                  },
                  limited),
              at_rest, 1e-12);
  EXPECT_GT(first_step_after([](Rig& rig) {  // but not after a linear one in mid-motion
              rig.add(0, over(8), {8.0});
              rig.pulse();
              rig.run(4);
            }),
            0.9);
}

TEST(Motion, AClampedMotionIsNotContinued) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits({.maximum = 2.0});
  Rig rig(schema);
  rig.add(0, over(8), {8.0});
  rig.pulse();
  rig.run(4);
  EXPECT_TRUE(rig.clamped());
  rig.add(0, overwriting(smoothly(over(100))), {1.0});
  rig.pulse();
  EXPECT_NEAR(rig.run(1)[0], 2.0 - minimum_jerk(0.01), 1e-12);
}

TEST(Motion, AQueuedMinimumJerkAfterALinearMotionStartsAtRest) {
  Rig rig(plain_robot(1));
  rig.add(0, over(4), {4.0});
  rig.add(0, smoothly(over(100)), {5.0});
  rig.pulse();
  EXPECT_NEAR(rig.run(5)[4], 4.0 + minimum_jerk(0.01), 1e-12);
}

TEST(Motion, TheRowsOfASmoothTrajectoryEachComeToRest) {
  Rig rig(plain_robot(1));
  rig.add_rows(0, smoothly(over(4)), 2, {1.0, 2.0});
  rig.pulse();
  const auto desired = rig.run(8);
  EXPECT_DOUBLE_EQ(desired[4], 1.0 + minimum_jerk(0.25));
  EXPECT_EQ(desired[7], 2.0);
}

TEST(Motion, ASpeedOfAMinimumJerkHoldsAlsoForWhatItContinues) {
  Rig rig(plain_robot(1));
  rig.add(0, over(1000), {1000.0});
  rig.pulse();
  rig.run(500);
  rig.add(0, overwriting(smoothly(at_speed(2000.0))), {-500.0});
  const CommandId batch = rig.pulse();
  const auto desired = rig.run(3000);
  EXPECT_EQ(rig.witness.status(batch + 2), Status::completed);
  EXPECT_LE(largest(differences(desired)), 2.0 * (1.0 + 1e-9));
  EXPECT_GT(largest(differences(desired)), 1.99) << "no slower than it has to be";
}

// every kind of number in one state
Schema mixed_robot() {
  Schema schema;
  schema.head.robot = NameText("mixed");
  schema.head.period = kMillisecond;
  for (const auto& [name, value] : {std::pair("open", 5), std::pair("shut", -3)}) {
    LabelRow label;
    label.name = NameText(name);
    label.value = value;
    schema.labels.push_back(label);
  }
  FieldRow gripper = scalar_field("gripper", Kind::enumeration);
  gripper.size = 2;
  gripper.is_signed = 1;
  gripper.labels = 2;
  const auto type = schema.add_type(
      "Mixed", {scalar_field("f64", Kind::float64), scalar_field("flag", Kind::boolean), gripper,
                scalar_field("f32", Kind::float32), scalar_field("i8", Kind::int8),
                scalar_field("u16", Kind::uint16), scalar_field("i64", Kind::int64),
                scalar_field("u64", Kind::uint64)});
  schema.add_actuators("mixed", type, 2);
  return schema;
}

struct Mixed {
  double f64;
  bool flag;
  std::int16_t gripper;
  float f32;
  std::int8_t i8;
  std::uint16_t u16;
  std::int64_t i64;
  std::uint64_t u64;
};

TEST(Motion, EveryKindOfNumberGoesItsWay) {
  Rig rig(mixed_robot());
  ASSERT_EQ(rig.schema.types[0].size, sizeof(Mixed));
  Mixed start{};
  start.gripper = -3;
  start.i8 = -3;
  std::memcpy(rig.observed.data(), &start, sizeof start);
  rig.controller.restart(rig.observed.data(), nullptr, 0);

  Mixed target{};
  target = {1.0,
            true,
            5,
            2.0F,
            4,
            65535,
            std::numeric_limits<std::int64_t>::max(),
            std::numeric_limits<std::uint64_t>::max()};
  RecordHead head = over(4);
  rig.batch.command(head, bytes_of_one(target));
  rig.pulse();
  rig.step();
  const auto now = rig.desired_as<Mixed>(0);
  EXPECT_EQ(now.f64, 0.25);
  EXPECT_TRUE(now.flag) << "booleans switch at the start";
  EXPECT_EQ(now.gripper, 5) << "so do enumerations";
  EXPECT_EQ(now.f32, 0.5F);
  EXPECT_EQ(now.i8, -1) << "-1.25 rounded to nearest";
  EXPECT_EQ(now.u16, 16384) << "16383.75 rounded to nearest";
  EXPECT_EQ(now.i64, std::int64_t{1} << 61);
  EXPECT_EQ(now.u64, std::uint64_t{1} << 62);
  rig.run(3);
  const auto end = rig.desired_as<Mixed>(0);
  EXPECT_EQ(end.i64, target.i64) << "bit for bit, though no double holds it";
  EXPECT_EQ(end.u64, target.u64);
  EXPECT_EQ(rig.desired_as<Mixed>(sizeof(Mixed)).f64, 0.0);
}

TEST(Motion, NoPaddingOfAnyoneReachesTheDesiredBlock) {
  Rig rig(mixed_robot());
  std::fill(rig.observed.begin(), rig.observed.end(), std::byte{0xAA});
  rig.observe<std::uint8_t>(8, 1);
  rig.controller.restart(rig.observed.data(), nullptr, 0);
  std::vector<std::byte> target(sizeof(Mixed), std::byte{0x01});
  const std::int16_t gripper = 5;
  std::memcpy(target.data() + offsetof(Mixed, gripper), &gripper, sizeof gripper);
  rig.batch.command(over(3), target);
  const CommandId batch = rig.pulse();
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(rig.controller.desired()[9], std::byte{0}) << "between the flag and the gripper";
    EXPECT_EQ(rig.controller.desired()[20], std::byte{0}) << "in front of i64";
    rig.step();
  }
  EXPECT_EQ(rig.witness.status(batch + 2), Status::completed);
}

TEST(Motion, TheWidestWayDoesNotOverflow) {
  Rig rig(plain_robot(1));
  constexpr double kLargest = std::numeric_limits<double>::max();
  rig.add(0, direct(), {-kLargest});
  rig.add(0, over(4), {kLargest});
  rig.add(0, smoothly(over(4)), {-kLargest});
  rig.pulse();
  for (const double value : rig.run(9)) EXPECT_TRUE(std::isfinite(value));
  EXPECT_EQ(rig.desired(), -kLargest);
}

TEST(Motion, FromAnObservedThatIsNoNumberItStartsFromTheDesiredOne) {
  for (const double none : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    Rig rig(plain_robot(1));
    rig.observe(0, none);
    rig.add(0, from_observed(over(4)), {8.0});
    rig.pulse();
    EXPECT_THAT(rig.run(4), ElementsAre(2.0, 4.0, 6.0, 8.0));
  }
}

// findings of 2026-11: the highest and lowest place of a minimum jerk cut by another one
struct Reach {
  double low;
  double high;
};

Reach reach_of(double first, const RecordHead& how, int cut, double second,
               const RecordHead& then) {
  Rig rig(plain_robot(1));
  rig.add(0, smoothly(how), {first});
  rig.pulse();
  auto desired = rig.run(cut);
  rig.add(0, overwriting(smoothly(then)), {second});
  const CommandId batch = rig.pulse();
  while (rig.controller.active()) desired.push_back(rig.run(1)[0]);
  EXPECT_EQ(rig.witness.status(batch + 2), Status::completed);
  EXPECT_EQ(rig.desired(), second);
  const auto [low, high] = std::minmax_element(desired.begin(), desired.end());
  return {*low, *high};
}

TEST(Motion, AnOverwritingMinimumJerkStaysBetweenWhereItWasAndItsTargets) {
  EXPECT_LE(reach_of(1.0, over(500), 100, 2.0, over(5000)).high, 2.0) << "12.09 before";
  EXPECT_LE(reach_of(1.0, over(300), 100, 0.5, over(3000)).high, 1.0) << "10.8 before";
  EXPECT_GE(reach_of(1.0, over(500), 400, 0.0, over(5000)).low, 0.0) << "-7.9 before";
  const Reach far = reach_of(-4.0, over(230), 221, 4.33, at_speed(1.5));
  EXPECT_LE(far.high, 4.33) << "81.7 before";
  EXPECT_GE(far.low, -4.0);
}

void turn(void* out, const void* from, const void* to, double share) {
  // twice the angle, to be told from the default
  const auto* a = static_cast<const double*>(from);
  const auto* b = static_cast<const double*>(to);
  auto* state = static_cast<double*>(out);
  state[0] = 2.0 * (a[0] + (b[0] - a[0]) * share);
  state[1] = share;
}

TEST(Motion, AStateTypeMayBringItsOwnInterpolation) {
  Schema schema = plain_robot(1, 2);
  schema.hooks[0].blend = turn;
  Rig rig(schema);
  rig.add(0, over(4), {1.0, 9.0});
  rig.add(0, smoothly(over(4)), {1.0, 9.0});
  rig.pulse();
  EXPECT_THAT(rig.run(4), ElementsAre(0.5, 1.0, 1.5, 1.0));
  EXPECT_EQ(rig.desired(1), 9.0) << "the target is hit without asking";
  rig.step();
  EXPECT_EQ(rig.desired(1), minimum_jerk(0.25));
}

}  // namespace
}  // namespace o80::test
