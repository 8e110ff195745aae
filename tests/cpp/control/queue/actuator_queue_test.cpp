#include "control/queue/actuator_queue.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "control/rig.hpp"

namespace o80::test {
namespace {

using testing::ElementsAre;

// rule C1
TEST(ActuatorQueue, ThousandsOfCommandsFollowEachOtherWithoutAnIdleIteration) {
  Rig rig(plain_robot(1));
  for (int i = 0; i < 3000; ++i) rig.add(0, over(1 + i % 3), {static_cast<double>(i)});
  const CommandId batch = rig.pulse();
  Iteration expected = 1;
  for (int i = 0; i < 6000; ++i) {
    rig.step();
    ASSERT_TRUE(rig.active());
  }
  for (CommandId i = 0; i < 3000; ++i) {
    ASSERT_EQ(rig.witness.changes[1 + 2 * i].id, batch + 2 + i);
    ASSERT_EQ(rig.witness.changes[1 + 2 * i].iteration, expected);
    expected = rig.witness.changes[2 + 2 * i].iteration + 1;
  }
  EXPECT_EQ(expected, 6001);
  rig.step();
  EXPECT_FALSE(rig.active());
}

TEST(ActuatorQueue, LateCommandsInARowAreToldAThousandAnIteration) {
  Rig rig(plain_robot(2));
  rig.run(5);
  for (int i = 0; i < 2500; ++i) rig.add(0, until(1), {9.0});
  rig.add(0, direct(), {1.0});
  rig.pulse();
  // what was dropped counts against the same thousand
  for (int i = 0; i < 10; ++i) rig.add(1, over(9), {1.0});
  rig.batch.purge(1);
  rig.pulse();
  const std::size_t before = rig.witness.changes.size();
  rig.step();
  EXPECT_EQ(rig.witness.changes.size() - before, Controller::kStatusesPerIteration);
  EXPECT_TRUE(rig.controller.pending());
  EXPECT_FALSE(rig.active());
  EXPECT_EQ(rig.desired(), 0.0);
  EXPECT_THAT(rig.run(2), ElementsAre(0.0, 1.0));
}

TEST(ActuatorQueue, ASpeedIsThePeakOfTheProfileChosen) {
  Rig rig(plain_robot(1));
  rig.add(0, smoothly(at_speed(100.0)), {1.0});
  const CommandId batch = rig.pulse();
  const auto desired = rig.run(25);
  EXPECT_EQ(rig.witness.last(batch + 2).iteration, 17) << "1.7 times as long";
  for (std::size_t i = 1; i < desired.size(); ++i) EXPECT_LE(desired[i] - desired[i - 1], 0.1);
}

// rule C20
TEST(ActuatorQueue, NumbersLeftOutKeepTheDesiredValueTheCommandStartedFrom) {
  Rig rig(plain_robot(1, 2));
  rig.add(0, direct(), {1.0, 7.0});
  rig.pulse();
  rig.step();
  rig.observe(0, 3.0);
  rig.observe(8, 30.0);
  rig.add_rows(0, from_observed(over(2)), 1, {5.0, std::nan("")}, {}, {0b01});
  rig.pulse();
  rig.step();
  EXPECT_EQ(rig.desired(0), 4.0) << "the number asked for starts from the observed one";
  EXPECT_EQ(rig.desired(1), 7.0);
  rig.step();
  EXPECT_EQ(rig.desired(0), 5.0);
  EXPECT_EQ(rig.desired(1), 7.0);
}

TEST(ActuatorQueue, ARobotThatMovedWhenItStartedIsHeldAtRest) {
  Schema schema = plain_robot(1, 2);
  schema.actuator(0).rests_at("x1", 0.0);
  Rig rig(schema);
  rig.observe(0, 1.0);
  rig.observe(8, 2.0);
  rig.controller.restart(rig.observed.data(), nullptr, 0);
  EXPECT_EQ(rig.desired(1), 2.0) << "row 0 is what was observed";
  rig.step();
  EXPECT_EQ(rig.desired(0), 1.0);
  EXPECT_EQ(rig.desired(1), 0.0);
}

TEST(ActuatorQueue, ManyActuatorsEachHaveTheirOwnQueue) {
  Rig rig(plain_robot(130));
  for (std::uint32_t i = 0; i < 130; i += 3) rig.add(i, over(1 + i), {1.0 + i});
  rig.pulse();
  for (int iteration = 1; iteration <= 130; ++iteration) {
    rig.step();
    for (std::uint32_t i = 0; i < 130; ++i) {
      const bool commanded = i % 3 == 0;
      ASSERT_EQ(rig.active(i), commanded && iteration <= static_cast<int>(i) + 1);
      ASSERT_DOUBLE_EQ(rig.desired(i), commanded ? std::min<double>(iteration, 1.0 + i) : 0.0);
    }
  }
}

}  // namespace
}  // namespace o80::test
