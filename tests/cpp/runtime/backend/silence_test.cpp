// The watchdog: a commander that shows no life while something of it acts, counted in iterations.

#include "runtime/hostile_frontend.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using SilenceTest = ManualBackendTest;

BackendOptions watched(Stale stale, std::int64_t silence = 5, bool bursting = false) {
  return {.segment = "pair", .bursting = bursting, .stale = stale, .silence = silence};
}

// rule W1
TEST_F(SilenceTest, PurgesTheCommandsOfASilentCommander) {
  play(watched(Stale::purge), R"(a = 0 to 100 over 100; run 6; a active; run 2
    a purged silence; 0 is 6  # five iterations after the batch)");
}

// rule K11
TEST_F(SilenceTest, AStarvedPlanActsAndAClosedOneDoesNot) {
  enum class Closed { no, by_its_last_chunk, by_order };
  for (const Closed closed : {Closed::no, Closed::by_its_last_chunk, Closed::by_order}) {
    auto [manual, frontend] = StartedPair(watched(Stale::halt));
    const std::array<std::uint32_t, 1> actuator{0};
    const std::array<std::uint32_t, 2> due{1, 2};
    const std::array<double, 2> rows{};
    frontend.add_chunk(
        actuator, due, std::as_bytes(std::span(rows)),
        {.anchor = frontend.published(), .plan = 1, .final = closed == Closed::by_its_last_chunk});
    if (closed == Closed::by_order) frontend.add_close_plan(1);
    const Batch batch = frontend.pulse();
    manual.run(3);
    EXPECT_EQ(batch.handle(0).status, Status::completed);
    EXPECT_EQ(frontend.latest().starved(0), closed == Closed::no);
    EXPECT_FALSE(frontend.latest().starved(1));
    EXPECT_FALSE(frontend.halted());
    manual.run(4);
    ASSERT_EQ(frontend.halted().has_value(), closed == Closed::no);
    if (closed != Closed::no) continue;
    EXPECT_EQ(frontend.halted()->iteration, 7);
    EXPECT_FALSE(frontend.latest().starved(0));
    EXPECT_EQ(frontend.latest().head().starvations, 1);
  }
}

// rule W7
TEST_F(SilenceTest, CountsPeriodsThatTheLoopMissedAfterWhatCameMeanwhile) {
  // ten milliseconds of grace after the gap
  play(watched(Stale::purge, 50), R"(a = 0 to 1000 over 1000; B: b = 1 to 1000 over 1000; run 5
    missed 100; run 1; 0 rows 5: 5 6  # a plan counts no missed periods
    B: alive; run 12; a purged silence; b active  # its sign of life came after the gap
    run 30; b active)");
}

TEST_F(SilenceTest, CountsNoPeriodsThatWereMissedWhileHalted) {
  play(watched(Stale::purge, 50), R"(take; a = pulse; run 2; B: halt; run 2; missed 1000; run 2
    B: resumed = resume 1; run 20; resumed completed
    B: b = 0 to 1; run 1; b rejected exclusive  # the holder has kept its control)");
}

// rule W4
TEST_F(SilenceTest, EndsWhatTheSilentCommanderHasScheduled) {
  play(watched(Stale::purge), R"(0 to 100 over 100; a = pulse; 1 to 5; take; later = pulse at 20
    B: b = 1 to 3 at 20; run 7
    later purged silence @7; later.1 purged  # when the silence is noticed, not when it was due
    run 14; b completed; 1 is 3  # what others scheduled acts
    0 is 6; again = 0 to 1; run 1; 0 is 1  # its sender is free to begin again)");
}

TEST_F(SilenceTest, AHaltEndsItTooAlsoWhatAHaltWouldLeave) {
  play(watched(Stale::halt), R"(a = 0 to 100 over 100; command = 1 to 5 at 20
    request = reset 9 at 20; run 7  # it is served while halted
    halted; command halted; request purged silence)");
}

TEST_F(SilenceTest, StopsIfToldSo) {
  play(watched(Stale::stop),
       "a = 0 to 100 over 100; run 7; ends; fails longer than the watchdog (silence)");
}

TEST_F(SilenceTest, HaltsIfToldSo) {
  play(watched(Stale::halt), R"(a = 0 to 100 over 100; run 7
    a halted @7; halted silence  # in the very iteration in which it was noticed
    a says pid)");
}

TEST_F(SilenceTest, BatchesOfAnotherFrontendAreNoLife) {
  play(watched(Stale::purge), R"(a = 0 to 100 over 100
    B: b = 1 to 0; run 1; B: b = 1 to 1; run 1; B: b = 1 to 2; run 1; B: b = 1 to 3; run 1
    B: b = 1 to 4; run 1; B: b = 1 to 5; run 1; B: b = 1 to 6; run 1; B: b = 1 to 7; run 1
    a purged; 1 is 7  # those of the other go on)");
}

TEST_F(SilenceTest, RejectedBatchesAreLifeOfTheirSenderOnly) {
  play(watched(Stale::purge), R"(take; 0 to 100 over 100; a = pulse
    B: b = 1 to 0; run 1; B: b = 1 to 1; run 1; B: b = 1 to 2; run 1; B: b = 1 to 3; run 1
    B: b = 1 to 4; run 1; B: b = 1 to 5; run 1; B: b = 1 to 6; run 1; B: b = 1 to 7; run 1
    b completed; a.1 purged)");
}

TEST_F(SilenceTest, ControlIsSomethingThatActsAndEnds) {
  play(watched(Stale::purge), R"(take; a = pulse; run 3; B: b = 0 to 1; run 1
    b rejected exclusive; run 4; B: c = 0 to 1; run 1; c completed)");
}

// rule W2
TEST_F(SilenceTest, KeepAliveAndPulsesAreLife) {
  play(watched(Stale::purge), R"(a = 0 to 100 over 100
    run 5; alive; run 5; alive; run 5; alive; run 5; alive; run 5; a active
    b = 1 to 1; run 5; b = 1 to 2; run 5; b = 1 to 3; run 5; b = 1 to 4; run 5; a active)");
}

TEST_F(SilenceTest, LifeCountsFromWhenItWasShown) {
  play(watched(Stale::purge, 10), R"(a = 0 to 100 over 100; run 4; alive  # it knows row 4
    run 10; a active; run 1; a purged @15)");
}

// rule W2
TEST_F(SilenceTest, ReadingIsNoLife) {
  std::string reads;
  for (const std::string i : {"1", "2", "3", "4", "5", "6"}) {
    reads += "run 1; 0 is " + i + "; 0 rows " + i + ": " + i + "; running; a active;";
  }
  play(watched(Stale::purge), "a = 0 to 100 over 100;" + reads + "run 2; a purged");
}

// rule W2
TEST_F(SilenceTest, AWaitForOnesOwnBatchIsLife) {
  std::string waits;  // each look of a wait that does not wait
  for (int i = 0; i < 19; ++i) waits += "run 1; a raises TimeoutError;";
  play(watched(Stale::purge, 3), "a = 0 to 20 over 20;" + waits + "a active");
}

TEST_F(SilenceTest, NothingThatActsNoSilence) {
  play(watched(Stale::stop), R"(a = 0 to 1; run 50; b = 0 to 100 over 100; run 5
    b active  # nor is the time before counted)");
}

// rule W3
TEST_F(SilenceTest, ABurstIsItsSendersLifeAndStandingStillCountsNone) {
  play(watched(Stale::purge, 5, true),
       "a = 0 to 100 over 100; burst 50; a active; burst 10; a active");
}

TEST_F(SilenceTest, AnothersBurstIsNot) {
  play(watched(Stale::purge, 5, true), "a = 0 to 100 over 100; B: burst 20; a purged");
}

TEST_F(SilenceTest, LifeFromTheFutureIsThatOfNow) {
  StartedBackend manual(watched(Stale::purge));
  HostileFrontend hostile;
  RecordHead head;
  head.pace = Pace::iterations;
  head.amount = 1000;
  hostile.command(1000.0, {.id = hostile.draw_id()}, head);
  hostile.page().life = std::numeric_limits<std::int64_t>::max();
  manual.run(10);
  EXPECT_TRUE(UntypedFrontend("pair").latest().active(0)) << "it may say what it likes";
  hostile.page().life = std::numeric_limits<std::int64_t>::min();
  manual.run(10);
  EXPECT_FALSE(UntypedFrontend("pair").latest().active(0)) << "but has to go on saying it";
}

/// As a driver would with `o80::rests_at(0)`: what is commanded are velocities.
void rest_at_zero(Schema& schema) {
  schema.limits.at(schema.actuators.at(0).first_limit).resting = 1;
}

// rule W1
TEST_F(SilenceTest, ADirectValueThatStillActsCountsAlthoughNothingIsQueued) {
  play(watched(Stale::purge), R"(a = 0 to 3; run 6; a completed; 0 is 3  # until the next one
    run 1; 0 is 0  # but not when its sender hangs)",
       rest_at_zero);
}

// rule W6
TEST_F(SilenceTest, WithoutAWatchdogADirectValueThatDoesNotRestIsRefused) {
  auto [manual, frontend] = StartedPair({.segment = "pair"}, rest_at_zero);
  EXPECT_THAT(message_of<InvalidArgument>([&] { add(frontend, 0, 3.0); }),
              AllOf(HasSubstr("actuator 'shoulder'"), HasSubstr("--silence")));
  add(frontend, 0, 0.0);
  add(frontend, 0, 3.0, {.pace = iterations(5)});
  add(frontend, 1, 3.0);
  EXPECT_EQ(frontend.added(), 3U) << "its rest, another pace, an actuator that has no rest";
}

TEST_F(SilenceTest, ASimulationNeedsNoWatchdog) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .bursting = true}, rest_at_zero);
  add(frontend, 0, 3.0);
  EXPECT_EQ(frontend.added(), 1U);
}

// rule W4
TEST_F(SilenceTest, HaltsUnlessAnotherPolicyIsAskedFor) {
  const StartedBackend manual({.segment = "watched", .silence = 7});
  const UntypedFrontend frontend("watched");
  EXPECT_EQ(frontend.schema().head.silence, 7);
  EXPECT_EQ(frontend.schema().head.stale, Stale::halt);
  EXPECT_EQ(ManualBackend({.segment = "other"}).backend.schema().head.stale, Stale::hold);
}

}  // namespace
}  // namespace o80::test
