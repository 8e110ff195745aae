#include "o80/runtime/backend.hpp"
#include <optional>
#include <utility>

#include "runtime/station.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class BackendTest : public StationTest {};

// rule O1
TEST_F(BackendTest, RowZeroIsTheRobotBeforeAnythingWasAsked) {
  Station station;
  station.now = {0.25, -0.5};
  station.start();
  const UntypedFrontend frontend("pair");
  const UntypedObservation row = frontend.latest();
  EXPECT_EQ(row.iteration(), 0);
  EXPECT_EQ(observed(row), 0.25);
  EXPECT_EQ(desired(row), 0.25);
  EXPECT_EQ(desired(row, 1), -0.5);
  EXPECT_FALSE(row.active(0));
}

// rule O2
TEST_F(BackendTest, ARowShowsWhatWasAskedAndWhatCameOfIt) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  send(frontend, 0, 1.0);
  station.run(1);
  const UntypedObservation row = frontend.latest();
  EXPECT_EQ(row.iteration(), 1);
  EXPECT_EQ(desired(row), 1.0);
  EXPECT_EQ(observed(row), 1.0);
  EXPECT_EQ(unpack<double>(row.extended()), 1.0);
  EXPECT_TRUE(row.active(0));
  EXPECT_FALSE(row.active(1));
}

TEST_F(BackendTest, IsStartingUntilRowZeroAndRunningFromThenOn) {
  Station station;
  EXPECT_THROW(UntypedFrontend("pair", {.timeout = kAtOnce}), TimeoutError);
  station.start();
  EXPECT_EQ(UntypedFrontend("pair").life(), Life::running);
}

TEST_F(BackendTest, TakesABatchWholeForAllActuators) {
  play(R"(0 to 1 over 2; run 2; 1 to 2 over 2; run 1; 0 rows 0: 0 0 0 0  # nothing was pulsed yet
    a = pulse; run 3; 0 rows 3: 0 0.5 1 1; 1 rows 3: 0 1 2 2; a taken 4; a ended 5)");
}

// rule B2
TEST_F(BackendTest, TakesBatchesInTheOrderOfTheirPulsesAcrossFrontends) {
  StartedStation station;
  UntypedFrontend one("pair");
  UntypedFrontend two("pair");
  std::vector<double> expected;
  for (int i = 1; i <= 20; ++i) {
    send(i % 3 == 0 ? one : two, 0, i);
    expected.push_back(i);
  }
  station.run(20);
  EXPECT_EQ(desired(one, 1, 20), expected) << "direct commands, one an iteration";

  const Batch first = send(two, 0, 100, {.mode = Mode::overwrite});
  const Batch second = send(one, 0, 200, {.mode = Mode::overwrite});
  station.run(1);
  EXPECT_EQ(desired(one.latest()), 200);
  EXPECT_EQ(first.handle(0).status, Status::overwritten);
  EXPECT_EQ(second.handle(0).status, Status::completed);
}

// rule B3
TEST_F(BackendTest, TakesABatchAtItsIterationExactly) {
  play(R"(later = 0 to 1 at 5; sooner = 0 to 2 at 3; now = 1 to 7 at 1; run 6
    0 rows 1: 0 0 2 2 1 1; 1 rows 1: 7; later taken 5; sooner taken 3; now taken 1)");
}

// rule B3
TEST_F(BackendTest, RejectsABatchWhoseIterationHasBegunUnlessItMayBeLate) {
  play(R"(run 4; a = 0 to 1 at 4; b = 1 to 2 at 4 late; run 2
    a rejected late @5; b completed; 0 is 0; 1 is 2)");
}

// rule S2
TEST_F(BackendTest, NothingIsCompletedBeforeItsRowIsOut) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 1.0);
  station.before_publish = [&] {
    EXPECT_FALSE(is_end(batch.handle(0).status)) << "the robot was not even asked";
    EXPECT_FALSE(batch.ended());
  };
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
  EXPECT_TRUE(batch.ended());
}

TEST_F(BackendTest, WhatEndsInARowThatIsNeverMadeIsNotCompleted) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 1.0);
  ASSERT_EQ(station.backend.try_step(), Step::run);
  station.backend.end(BackendState::failed, "the arm fell off");
  EXPECT_EQ(batch.handle(0).status, Status::purged);
  EXPECT_EQ(batch.handle(0).reason, Reason::stopped);
  EXPECT_THROW(batch.wait(kPatience), BackendFailed);
}

// rule B1
TEST_F(BackendTest, StagesALargeBatchOverSeveralIterationsAndThenTakesItWhole) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  UntypedFrontend other("pair");
  constexpr int kCommands = 3000;  // of a block each: three iterations of 1024
  for (int i = 0; i < kCommands; ++i) add(frontend, 0, i + 1);
  add(frontend, 1, -1.0);
  const Batch large = frontend.pulse();
  const Batch behind = send(other, 1, -2.0);
  for (int i = 0; i < 10 && large.first_iteration() < 0; ++i) station.run(1);
  station.run(1);
  EXPECT_GE(large.first_iteration(), 3) << "1024 blocks an iteration";
  const Iteration taken = large.first_iteration();
  for (Iteration i = 1; i < taken; ++i) {
    EXPECT_THAT(desired(frontend, i, i, 0), ElementsAre(0));
    EXPECT_THAT(desired(frontend, i, i, 1), ElementsAre(0));
  }
  EXPECT_THAT(desired(frontend, taken, taken, 0), ElementsAre(1));
  EXPECT_THAT(desired(frontend, taken, taken + 1, 1), ElementsAre(-1, -2)) << "in order";
  station.run(kCommands);
  EXPECT_EQ(desired(frontend.latest()), kCommands);
  EXPECT_EQ(large.last_iteration(), taken + kCommands - 1) << "no idle iteration";
  EXPECT_TRUE(behind.ended());
}

TEST_F(BackendTest, GivesTheMemoryOfALaneBackForEver) {
  StartedStation station({.segment = "pair", .lanes = 2, .lane_blocks = 64});
  UntypedFrontend frontend("pair");
  for (int round = 0; round < 2000; ++round) {
    for (int i = 0; i < 10; ++i) add(frontend, i % 2, round, {.mode = Mode::overwrite});
    const Batch batch = frontend.pulse();
    station.run(2);
    ASSERT_TRUE(batch.ended()) << round;
  }
}

TEST_F(BackendTest, InterruptsAnActuatorInTheIterationUnderWay) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 10.0, {.pace = iterations(10)});
  add(frontend, 0, 20.0, {.pace = iterations(10)});
  add(frontend, 1, 10.0, {.pace = iterations(10)});
  const Batch batch = frontend.pulse();
  station.run(2);
  station.before_publish = [&] { station.backend.interrupt(0); };
  station.run(1);
  station.before_publish = {};
  EXPECT_EQ(batch.handle(0).status, Status::interrupted);
  EXPECT_EQ(batch.handle(0).iteration, 3);
  EXPECT_EQ(batch.handle(1).status, Status::interrupted);
  EXPECT_EQ(batch.handle(2).status, Status::active);
  station.run(2);
  EXPECT_THAT(desired(frontend, 3, 5), ElementsAre(3, 3, 3)) << "held where it was";
  EXPECT_THAT(desired(frontend, 3, 5, 1), ElementsAre(3, 4, 5));
}

// rule O8
TEST_F(BackendTest, TellsTimeByTheIterationWhenItBursts) {
  StartedStation station({.segment = "pair", .period = 2'000'000, .bursting = true});
  UntypedFrontend frontend("pair");
  frontend.start_burst(3);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(frontend.latest().time(), 6'000'000);
  EXPECT_EQ(frontend.schema().head.clock, Clock::simulated);
}

TEST_F(BackendTest, PublishesTheTimingOfThePeriods) {
  StartedStation station;
  station.backend.set_timing({.lateness = 17, .overruns = 2, .skipped = 5});
  station.run(1);
  const RowHead head = UntypedFrontend("pair").latest().head();
  EXPECT_EQ(head.lateness, 17);
  EXPECT_EQ(head.overruns, 2U);
  EXPECT_EQ(head.skipped, 5U);
  EXPECT_GT(head.time, 0);
}

TEST_F(BackendTest, RefusesOptionsThatCannotBe) {
  EXPECT_THAT(
      message_of<InvalidArgument>([] { Station({.segment = "pair", .period = -2'000'000'000}); }),
      HasSubstr("period must be positive, got -2 s"));
  EXPECT_THAT(message_of<InvalidArgument>(
                  [] { Station({.segment = "pair", .stale = Stale::hold, .silence = 1000}); }),
              HasSubstr("purge, halt or stop"));
  for (const mode_t wrong : {0U, 0200U, 644U}) {  // the last forgot its leading 0
    EXPECT_THAT(
        message_of<InvalidArgument>([&] { Station({.segment = "pair", .permission = wrong}); }),
        HasSubstr("permission must be an octal mode"));
  }
  EXPECT_EQ(directory_.files(), 0U);
}

// ------------------------------------------------------------------------------ requests

// rule O12
TEST_F(BackendTest, StartsAfreshInARowOfItsOwn) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  const Batch moving = send(frontend, 1, 9.0, {.pace = iterations(9)});
  station.run(3);
  add_request(frontend, Reset{.seed = 5});
  add(frontend, 1, 1.0);
  const Batch batch = frontend.pulse();
  station.run(1);
  const UntypedObservation fresh = frontend.wait_for(4, kAtOnce);
  EXPECT_EQ(fresh.head().fresh, 1U);
  EXPECT_EQ(observed(fresh), 5.0);
  EXPECT_EQ(desired(fresh), 5.0);
  EXPECT_EQ(desired(fresh, 1), 0.0);
  EXPECT_FALSE(fresh.active(1));
  EXPECT_EQ(moving.handle(0).status, Status::purged);
  EXPECT_EQ(moving.handle(0).reason, Reason::fresh_start);
  EXPECT_EQ(moving.handle(0).iteration, 4);

  const UntypedObservation after = frontend.latest();
  EXPECT_EQ(after.iteration(), 5) << "the count goes on";
  EXPECT_EQ(after.head().fresh, 0U);
  EXPECT_EQ(desired(after, 1), 1.0) << "what came with the request acts after it";
  EXPECT_EQ(batch.handle(0).status, Status::completed);
  EXPECT_EQ(batch.handle(0).iteration, 4) << "that of the fresh row";
  EXPECT_EQ(batch.first_iteration(), 4);
  EXPECT_EQ(batch.last_iteration(), 5);
}

TEST_F(BackendTest, AloneAFreshStartEndsItsBatchInItsOwnRow) {
  play("a = reset 5; run 1; a ended 1; 0 rows 1: 5");
}

TEST_F(BackendTest, ItsPhaseFollowsStepPublishBrakeAndEnd) {
  Station station;
  UntypedBackend& backend = station.backend;
  Phase at_publish = Phase::ready;
  station.before_publish = [&] { at_publish = backend.phase(); };
  EXPECT_EQ(backend.phase(), Phase::starting);
  station.start();
  EXPECT_EQ(backend.phase(), Phase::ready);
  UntypedFrontend frontend("pair");
  send(frontend, 0, 1.0, {.pace = iterations(9)});
  station.run(1);
  EXPECT_EQ(at_publish, Phase::iterating);
  EXPECT_EQ(backend.phase(), Phase::ready);
  EXPECT_EQ(backend.brake(), Step::run);
  EXPECT_EQ(backend.phase(), Phase::braking);
  EXPECT_TRUE(backend.publish());
  EXPECT_EQ(backend.phase(), Phase::stopping);
  EXPECT_EQ(backend.brake(), Step::ended);
  backend.end(BackendState::stopped);
  EXPECT_EQ(backend.phase(), Phase::ended);
}

TEST_F(BackendTest, EndsAsFailedWhenARequestBreaksIt) {
  std::optional<Station> station(std::in_place);
  station->start();
  UntypedFrontend frontend("pair");
  add_request<Break>(frontend);
  const Batch batch = frontend.pulse();
  EXPECT_EQ(station->iterate(), Step::ended);
  EXPECT_EQ(station->backend.failure(), "the arm fell off");
  station.reset();
  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_EQ(batch.handle(0).text, "the arm fell off");
  EXPECT_THAT(message_of<BackendFailed>([&] { frontend.wait_for(9, kPatience); }),
              HasSubstr("the arm fell off"));
}

// ------------------------------------------------------------------------------ stopping

// rule S6
TEST_F(BackendTest, EndsEveryCommandWhenItStops) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 1.0, {.pace = iterations(50)});
  add(frontend, 0, 2.0, {.pace = iterations(50)});
  const Batch running = frontend.pulse();
  add(frontend, 1, 1.0);
  const Batch scheduled = frontend.pulse({.at = 90});
  station.run(2);
  station.backend.end(BackendState::stopped);
  EXPECT_EQ(running.handle(0).status, Status::purged);
  EXPECT_EQ(running.handle(0).reason, Reason::stopped);
  EXPECT_EQ(running.handle(1).status, Status::purged);
  EXPECT_EQ(scheduled.handle(0).status, Status::rejected);
  EXPECT_EQ(scheduled.handle(0).reason, Reason::stopped);
  EXPECT_THROW(running.wait(kPatience), BackendStopped);
  EXPECT_THROW(scheduled.wait(kPatience), BackendStopped);
  EXPECT_THROW(send(frontend, 0, 1.0), BackendStopped);
}

}  // namespace
}  // namespace o80::test
