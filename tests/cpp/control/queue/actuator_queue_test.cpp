#include "control/queue/actuator_queue.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "control/rig.hpp"

namespace o80::test {
namespace {

using testing::ElementsAre;

TEST(ActuatorQueue, ReachesItsTargetExactlyAtTheLastIteration) {
  Rig rig(plain_robot(1));
  rig.add(0, until(4), {1.0});
  rig.pulse();
  EXPECT_THAT(rig.run(5), ElementsAre(0.25, 0.5, 0.75, 1.0, 1.0));
}

TEST(ActuatorQueue, DirectCommandsActAtOnceOneAnIteration) {
  Rig rig(plain_robot(1));
  for (const double target : {3.0, -1.0, 2.0}) rig.add(0, direct(), {target});
  rig.pulse();
  EXPECT_THAT(rig.run(4), ElementsAre(3.0, -1.0, 2.0, 2.0));
}

TEST(ActuatorQueue, TheNextCommandStartsWhereAndWhenTheLastEnded) {
  Rig rig(plain_robot(1));
  rig.add(0, over(2), {1.0});
  rig.add(0, over(4), {0.0});
  const CommandId batch = rig.pulse();
  EXPECT_THAT(rig.run(7), ElementsAre(0.5, 1.0, 0.75, 0.5, 0.25, 0.0, 0.0));
  EXPECT_EQ(rig.witness.of(batch + 2)[0].iteration, 1);
  EXPECT_EQ(rig.witness.of(batch + 2)[1].iteration, 2);
  EXPECT_EQ(rig.witness.of(batch + 3)[0].iteration, 3);
  EXPECT_EQ(rig.witness.of(batch + 3)[1].iteration, 6);
}

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

TEST(ActuatorQueue, ACommandStartsFromTheDesiredStateUnlessItAsksForTheObserved) {
  Rig rig(plain_robot(1));
  rig.add(0, direct(), {4.0});
  rig.pulse();
  rig.run(1);
  rig.observe(0, 2.0);
  rig.add(0, over(4), {0.0});
  rig.add(0, from_observed(over(4)), {0.0});
  rig.pulse();
  EXPECT_THAT(rig.run(8), ElementsAre(3.0, 2.0, 1.0, 0.0, 1.5, 1.0, 0.5, 0.0));
}

TEST(ActuatorQueue, OnlyTheFirstRowOfATrajectoryStartsFromTheObserved) {
  Rig rig(plain_robot(1));
  rig.observe(0, 2.0);
  rig.add_rows(0, from_observed(over(2)), 2, {4.0, 6.0});
  rig.pulse();
  EXPECT_THAT(rig.run(4), ElementsAre(3.0, 4.0, 5.0, 6.0));
}

TEST(ActuatorQueue, UntilCountsTheIterationsThatAreLeftWhenItStarts) {
  Rig rig(plain_robot(1));
  rig.add(0, over(3), {3.0});
  rig.add(0, until(5), {5.0});
  const CommandId batch = rig.pulse();
  EXPECT_THAT(rig.run(6), ElementsAre(1.0, 2.0, 3.0, 4.0, 5.0, 5.0));
  EXPECT_EQ(rig.witness.last(batch + 3).iteration, 5);
}

TEST(ActuatorQueue, AnUntilOfTheIterationItStartsInTakesOne) {
  Rig rig(plain_robot(1));
  rig.add(0, until(1), {5.0});
  rig.pulse();
  EXPECT_THAT(rig.run(2), ElementsAre(5.0, 5.0));
}

TEST(ActuatorQueue, APastUntilIsRejectedAsLateAndTheNextStartsInItsPlace) {
  Rig rig(plain_robot(1));
  rig.add(0, over(3), {3.0});
  rig.add(0, until(2), {9.0});
  rig.add(0, until(3), {9.0});
  rig.add(0, over(2), {5.0});
  const CommandId batch = rig.pulse();
  EXPECT_THAT(rig.run(5), ElementsAre(1.0, 2.0, 3.0, 4.0, 5.0));
  for (const CommandId late : {batch + 3, batch + 4}) {
    EXPECT_EQ(rig.witness.last(late).status, Status::rejected);
    EXPECT_EQ(rig.witness.last(late).reason, Reason::late);
    EXPECT_EQ(rig.witness.last(late).iteration, 4);
    EXPECT_EQ(rig.witness.of(late).size(), 1U);
  }
  EXPECT_EQ(rig.witness.of(batch + 5)[0].iteration, 4);
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

std::vector<Iteration> ends_of(const Rig& rig, CommandId batch, CommandId commands) {
  std::vector<Iteration> ends;
  ends.reserve(commands);
  for (CommandId i = 0; i < commands; ++i)
    ends.push_back(rig.witness.last(batch + 2 + i).iteration);
  return ends;
}

TEST(ActuatorQueue, ACountedCommandKeepsWhatTheDurationsCarry) {
  Rig rig(plain_robot(1));
  rig.add(0, during(1'300'000), {1.0});
  rig.add(0, over(2), {1.0});
  rig.add(0, direct(), {1.0});
  rig.add(0, during(1'300'000), {1.0});
  const CommandId batch = rig.pulse();
  rig.run(12);
  EXPECT_THAT(ends_of(rig, batch, 4), ElementsAre(1, 3, 4, 6));
}

TEST(ActuatorQueue, UntilAndIdlenessAndOverwritingAndTheMinimumResetTheCarry) {
  const auto second_of = [](auto between) {
    Rig rig(plain_robot(1));
    rig.add(0, during(1'400'000), {1.0});
    between(rig);
    const Iteration begin = rig.next;
    CommandId batch = 0;
    if (rig.batch.empty()) {  // the first command has run
      rig.add(0, during(1'400'000), {1.0});
      batch = rig.pulse();
      rig.run(12);
      return rig.witness.last(batch + 2).iteration - begin + 1;
    }
    rig.add(0, during(1'400'000), {1.0});
    const CommandId last = rig.batch.records();
    batch = rig.pulse();
    rig.run(12);
    const auto changes = rig.witness.of(batch + 1 + last);
    return changes[1].iteration - changes[0].iteration + 1;
  };
  EXPECT_EQ(second_of([](Rig&) {}), 2) << "0.4 + 1.4 is nearly 2";
  EXPECT_EQ(second_of([](Rig& rig) { rig.add(0, until(3), {2.0}); }), 1);
  EXPECT_EQ(second_of([](Rig& rig) { rig.pulse(), rig.run(2); }), 1);
  EXPECT_EQ(second_of([](Rig& rig) { rig.pulse(), rig.run(1); }), 2) << "the queue is unbroken";
  EXPECT_EQ(second_of([](Rig& rig) { rig.add(0, overwriting(over(1)), {2.0}); }), 1);
  EXPECT_EQ(second_of([](Rig& rig) { rig.add(0, during(0), {2.0}); }), 1);
}

TEST(ActuatorQueue, ASpeedIsNeverExceededAndTheCommandTakesNoLongerThanItMust) {
  Rig rig(plain_robot(1));
  rig.add(0, at_speed(100.0), {1.0});    // 10 iterations
  rig.add(0, at_speed(100.0), {0.95});   // half an iteration
  rig.add(0, at_speed(100.0), {1.251});  // 3.01
  const CommandId batch = rig.pulse();
  rig.run(20);
  EXPECT_THAT(ends_of(rig, batch, 3), ElementsAre(10, 11, 15));
}

TEST(ActuatorQueue, ASpeedIsThePeakOfTheProfileChosen) {
  Rig rig(plain_robot(1));
  rig.add(0, smoothly(at_speed(100.0)), {1.0});
  const CommandId batch = rig.pulse();
  const auto desired = rig.run(25);
  EXPECT_EQ(rig.witness.last(batch + 2).iteration, 17) << "1.7 times as long";
  for (std::size_t i = 1; i < desired.size(); ++i) EXPECT_LE(desired[i] - desired[i - 1], 0.1);
}

TEST(ActuatorQueue, ASpeedConcernsTheFirstNumberOfTheState) {
  Rig rig(plain_robot(1, 2));
  rig.add(0, at_speed(1000.0), {2.0, 1000.0});
  const CommandId batch = rig.pulse();
  rig.run(5);
  EXPECT_EQ(rig.witness.last(batch + 2).iteration, 2);
}

TEST(ActuatorQueue, ATrajectoryIsOneCommandWithOneEnd) {
  Rig rig(plain_robot(1));
  rig.add_rows(0, over(2), 3, {2.0, 4.0, 0.0});
  const CommandId batch = rig.pulse();
  EXPECT_THAT(rig.run(7), ElementsAre(1.0, 2.0, 3.0, 4.0, 2.0, 0.0, 0.0));
  const auto changes = rig.witness.of(batch + 2);
  ASSERT_EQ(changes.size(), 2U);
  EXPECT_EQ(changes[0].status, Status::active);
  EXPECT_EQ(changes[0].iteration, 1);
  EXPECT_EQ(changes[1].status, Status::completed);
  EXPECT_EQ(changes[1].iteration, 6);
}

TEST(ActuatorQueue, ADirectTrajectoryGivesARowAnIteration) {
  Rig rig(plain_robot(1, 3));
  std::vector<double> rows(300);
  std::iota(rows.begin(), rows.end(), 0.0);
  rig.add_rows(0, direct(), 100, rows);
  rig.pulse();
  for (int row = 0; row < 100; ++row) {
    rig.step();
    for (std::uint32_t number = 0; number < 3; ++number) {
      ASSERT_EQ(rig.desired(number), 3.0 * row + number);
    }
  }
}

TEST(ActuatorQueue, ATrajectoryWithTimesOfItsOwnHitsEachRowAtItsRoundedTime) {
  Rig rig(plain_robot(1));
  rig.add_rows(0, during(0), 4, {1.0, 2.0, 3.0, 4.0}, {1'600'000, 2'400'000, 5'000'000, 6'500'000});
  const CommandId batch = rig.pulse();
  // the second row would end when the first one does: it is passed
  const auto desired = rig.run(9);
  EXPECT_EQ(desired[1], 1.0);
  EXPECT_EQ(desired[2], 1.0 + 2.0 / 3.0);
  EXPECT_EQ(desired[4], 3.0);
  EXPECT_EQ(desired[6], 4.0);
  EXPECT_EQ(rig.witness.last(batch + 2).iteration, 7);
}

TEST(ActuatorQueue, ASpeedOfATrajectoryHoldsForEachRow) {
  Rig rig(plain_robot(1));
  rig.add_rows(0, at_speed(1000.0), 2, {3.0, 1.0});
  rig.pulse();
  EXPECT_THAT(rig.run(6), ElementsAre(1.0, 2.0, 3.0, 2.0, 1.0, 1.0));
}

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

TEST(ActuatorQueue, APartialTrajectoryLeavesTheOtherNumbersAlone) {
  Rig rig(plain_robot(1, 2));
  rig.add_rows(0, over(2), 2, {9.0, 4.0, 9.0, 8.0}, {}, {0b10});
  rig.pulse();
  EXPECT_THAT(rig.run(4, 1), ElementsAre(2.0, 4.0, 6.0, 8.0));
  EXPECT_EQ(rig.desired(0), 0.0);
}

TEST(ActuatorQueue, AnIdleActuatorHoldsItsLastDesiredState) {
  Rig rig(plain_robot(1));
  rig.add(0, direct(), {4.0});
  rig.pulse();
  rig.observe(0, 2.0);
  EXPECT_THAT(rig.run(3), ElementsAre(4.0, 4.0, 4.0));
  EXPECT_FALSE(rig.active());
}

TEST(ActuatorQueue, AnIdleActuatorThatFollowsLetsTheNextCommandStartFromWhereItIs) {
  Schema schema = plain_robot(2);
  schema.actuator(0).when_idle(WhenIdle::follow);
  Rig rig(schema);
  rig.observe(0, 2.0);
  rig.observe(8, 2.0);
  EXPECT_THAT(rig.run(2), ElementsAre(2.0, 2.0));
  EXPECT_EQ(rig.desired(1), 0.0) << "the other one holds";
  rig.add(0, over(2), {4.0});
  rig.add(0, over(2), {6.0});
  rig.pulse();
  EXPECT_THAT(rig.run(4), ElementsAre(3.0, 4.0, 5.0, 6.0)) << "not while it is commanded";
  rig.observe(0, 3.5);
  EXPECT_THAT(rig.run(1), ElementsAre(3.5)) << "from its first idle iteration on";
  rig.observe(0, 3.0);
  EXPECT_THAT(rig.run(1), ElementsAre(3.0));
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
