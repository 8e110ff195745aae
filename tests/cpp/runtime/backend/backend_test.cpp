#include "o80/runtime/backend.hpp"
#include <optional>

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

class BackendTest : public ManualBackendTest {};

// rule O1
TEST_F(BackendTest, RowZeroIsTheRobotBeforeAnythingWasAsked) {
  ManualBackend manual;
  manual.now = {0.25, -0.5};
  manual.start();
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
  auto [manual, frontend] = StartedPair();
  send(frontend, 0, 1.0);
  manual.run(1);
  const UntypedObservation row = frontend.latest();
  EXPECT_EQ(row.iteration(), 1);
  EXPECT_EQ(desired(row), 1.0);
  EXPECT_EQ(observed(row), 1.0);
  EXPECT_EQ(unpack<double>(row.extended()), 1.0);
  EXPECT_TRUE(row.active(0));
  EXPECT_FALSE(row.active(1));
}

TEST_F(BackendTest, TakesABatchWholeForAllActuators) {
  play(R"(0 to 1 over 2; run 2; 1 to 2 over 2; run 1; 0 rows 0: 0 0 0 0  # nothing was pulsed yet
    a = pulse; run 3; 0 rows 3: 0 0.5 1 1; 1 rows 3: 0 1 2 2; a taken 4; a ended 5)");
}

// rule B2
TEST_F(BackendTest, TakesBatchesInTheOrderOfTheirPulsesAcrossFrontends) {
  play(R"(a = 0 to 1; B: b = 0 to 2; B: b = 0 to 3; a = 0 to 4; B: b = 0 to 5; a = 0 to 6; run 6
    0 rows 1: 1 2 3 4 5 6  # direct commands, one an iteration
    B: b = 0 to 100 overwrite; a = 0 to 200 overwrite; run 1; 0 is 200; b overwritten
    a completed)");
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
  play("a = 0 to 1; in 1 a queued; in 1 a open; run 1; a completed; a ended 1");
}

TEST_F(BackendTest, WhatEndsInARowThatIsNeverMadeIsNotCompleted) {
  auto [manual, frontend] = StartedPair();
  const Batch batch = send(frontend, 0, 1.0);
  ASSERT_EQ(manual.backend.try_step(), Step::run);
  manual.backend.end(BackendState::failed, "the arm fell off");
  EXPECT_EQ(batch.handle(0).status, Status::purged);
  EXPECT_EQ(batch.handle(0).reason, Reason::stopped);
  EXPECT_THROW(batch.wait(kPatience), BackendFailed);
}

// rule B1
TEST_F(BackendTest, StagesALargeBatchOverSeveralIterationsAndThenTakesItWhole) {
  std::string many;  // of a block each: more than two iterations of 1024
  for (int i = 1; i <= 3000; ++i) many += "0 to " + std::to_string(i) + ";";
  play(many + R"(1 to -1; a = pulse; B: b = 1 to -2; run 5; a taken -1; run 3000; a taken 6
    0 rows 1: 0 0 0 0 0 1; 1 rows 1: 0 0 0 0 0 -1 -2  # in order
    0 is 3000; a ended 3005; b completed  # no idle iteration)");
}

// rule C23
TEST_F(BackendTest, InterruptsAnActuatorInTheIterationUnderWay) {
  play(R"(0 to 10 over 10; 0 to 20 over 10; 1 to 10 over 10; a = pulse; in 3 interrupt 0
    in 3 interrupt 77; run 3  # there is no such actuator
    a interrupted @3; a.1 interrupted; a.2 active; run 2
    0 rows 3: 3 3 3; 1 rows 3: 3 4 5  # held where it was)");
}

// ------------------------------------------------------------------------------ queues

// rule C2
TEST_F(BackendTest, OverwritingAndPurgesDropWhatIsQueued) {
  play(R"(0 to 4 over 4; 0 to 2 over 2 overwrite; 0 to 5 over 1; a = pulse; run 3; 0 rows 1: 1 2 5
    a overwritten @1; a.1 completed @2  # of its own batch too)");
  play(R"(0 to 4 over 4; 0 to 8 over 4; 1 to 4 over 4; a = pulse; run 2; b = purge 0; run 2
    0 rows 3: 2 2; 1 is 4; a purged @3; a.1 purged @3; b completed @3; a.2 completed @4; a ended 4
    c = 1 to 13 over 9; run 1; d = purge; run 1; c purged @6; 1 rows 5: 5 5)");
  play(R"(0 to 4 over 4; 1 to 4 over 4; purge 0; 0 to 1 over 2; 1 to 0 over 4; a = pulse; run 3
    0 rows 1: 0.5 1 1; 1 rows 1: 1 2 3; a purged; a.3 completed  # in the order of its batch)");
}

TEST_F(BackendTest, AFrontendMayPurgeOnlyWhatItSent) {
  play(R"(a = 0 to 2 over 2; B: 0 to 4 over 2; B: 1 to 4 over 2; B: b = pulse; c = 0 to 9 over 2
    d = purge own; run 3; 0 rows 1: 2 4 4; 1 rows 1: 2 4; a purged; c purged; b completed
    b.1 completed)");
}

/// What a duration leaves of an iteration is owed to the next one of an unbroken queue.
TEST_F(BackendTest, UntilAndIdlenessAndOverwritingAndTheMinimumResetTheCarry) {
  play("0 to 1 for 1.4; 0 to 2 for 1.4; a = pulse; run 3; a completed @1; a.1 completed @3");
  play("a = 0 to 1 for 1.4; run 1; b = 0 to 2 for 1.4; run 2; b completed @3");
  play("a = 0 to 1 for 1.4; run 2; b = 0 to 2 for 1.4; run 1; b completed @3");
  play("0 to 1 for 1.4; 0 to 2 until 3; 0 to 1 for 1.4; a = pulse; run 4; a.2 completed @4");
  play(R"(0 to 1 for 1.4; 0 to 2 over 1 overwrite; 0 to 1 for 1.4; a = pulse; run 2
    a.2 completed @2)");
  play("0 to 1 for 1.4; 0 to 2 for 0; 0 to 1 for 1.4; a = pulse; run 3; a.2 completed @3");
}

// rule C10
TEST_F(BackendTest, APastUntilIsRejectedAsLateAndTheNextStartsInItsPlace) {
  play(R"(0 to 3 over 3; 0 to 9 until 2; 0 to 9 until 3; 0 to 5 over 2; a = pulse; run 5
    0 rows 1: 1 2 3 4 5; a.1 rejected late @4; a.2 rejected late @4; a.3 completed @5)");
}

// rule O8
TEST_F(BackendTest, TellsTimeByTheIterationWhenItBursts) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .period = 2'000'000, .bursting = true});
  frontend.start_burst(3);
  EXPECT_EQ(manual.drive(), Step::standing);
  EXPECT_EQ(frontend.latest().time(), 6'000'000);
  EXPECT_EQ(frontend.schema().head.clock, Clock::simulated);
}

TEST_F(BackendTest, PublishesTheTimingOfThePeriods) {
  StartedBackend manual;
  manual.backend.set_timing({.lateness = 17, .overruns = 2, .skipped = 5});
  manual.run(1);
  const RowHead head = UntypedFrontend("pair").latest().head();
  EXPECT_EQ(head.lateness, 17);
  EXPECT_EQ(head.overruns, 2U);
  EXPECT_EQ(head.skipped, 5U);
  EXPECT_GT(head.time, 0);
}

TEST_F(BackendTest, RefusesOptionsThatCannotBe) {
  EXPECT_THAT(message_of<InvalidArgument>(
                  [] { ManualBackend({.segment = "pair", .period = -2'000'000'000}); }),
              HasSubstr("period must be positive, got -2 s"));
  EXPECT_THAT(message_of<InvalidArgument>([] {
                ManualBackend({.segment = "pair", .stale = Stale::hold, .silence = 1000});
              }),
              HasSubstr("purge, halt or stop"));
  for (const mode_t wrong : {0U, 0200U, 644U}) {  // the last forgot its leading 0
    EXPECT_THAT(message_of<InvalidArgument>(
                    [&] { ManualBackend({.segment = "pair", .permission = wrong}); }),
                HasSubstr("permission must be an octal mode"));
  }
  EXPECT_EQ(directory_.files(), 0U);
}

// ------------------------------------------------------------------------------ requests

// rule O12
TEST_F(BackendTest, StartsAfreshInARowOfItsOwn) {
  play(R"(moving = 1 to 9 over 9; run 3; 0 to 8 over 8; reset 5; 1 to 1; a = pulse; run 1
    row 4 fresh; 0 rows 4: 5; 1 rows 4: 0; moving purged fresh_start @4
    last 5; row 5 free  # the count goes on
    1 is 1; a purged; a.1 completed @4; a.2 completed; a taken 4; a ended 5  # it acts afterwards
    b = reset 5; run 1; b ended 6)");
}

TEST_F(BackendTest, ItsPhaseFollowsStepPublishBrakeAndEnd) {
  ManualBackend manual;
  UntypedBackend& backend = manual.backend;
  Phase at_publish = Phase::ready;
  manual.before_publish = [&] { at_publish = backend.phase(); };
  EXPECT_EQ(backend.phase(), Phase::starting);
  manual.start();
  EXPECT_EQ(backend.phase(), Phase::ready);
  UntypedFrontend frontend("pair");
  send(frontend, 0, 1.0, {.pace = iterations(9)});
  manual.run(1);
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
  std::optional<Trace> trace(std::in_place, BackendOptions{.segment = "pair"});
  trace->play("a = break; ends; fails the arm fell off; a rejected; a says the arm fell off");
  UntypedFrontend frontend("pair");
  trace.reset();
  EXPECT_THAT(message_of<BackendFailed>([&] { frontend.wait_for(9, kPatience); }),
              HasSubstr("the arm fell off"));
}

// ------------------------------------------------------------------------------ stopping

// rule S6
TEST_F(BackendTest, EndsEveryCommandWhenItStops) {
  play(R"(0 to 1 over 50; 0 to 2 over 50; a = pulse; b = 1 to 1 at 90; run 2; end stopped
    a purged stopped; a.1 purged; b rejected stopped; a raises BackendStopped
    b raises BackendStopped)");
}

}  // namespace
}  // namespace o80::test
