// The watchdog: a commander that shows no life while something of it acts, counted in iterations.

#include <gmock/gmock.h>

#include "memory/child_process.hpp"
#include "o80/base/error.hpp"
#include "runtime/liar.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using SilenceTest = StationTest;

BackendOptions watched(Stale stale, std::int64_t silence = 5) {
  return {.segment = "pair", .stale = stale, .silence = silence};
}

// rule W1
TEST_F(SilenceTest, PurgesTheCommandsOfASilentCommander) {
  StartedStation station(watched(Stale::purge));
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 100.0, {.pace = iterations(100)});
  station.run(6);
  EXPECT_EQ(batch.handle(0).status, Status::active);
  station.run(2);
  EXPECT_EQ(batch.handle(0).status, Status::purged);
  EXPECT_EQ(batch.handle(0).reason, Reason::silence);
  EXPECT_EQ(desired(frontend.latest()), 6.0) << "five iterations after the batch";
}

// rule K11
TEST_F(SilenceTest, AStarvedPlanActsAndAClosedOneDoesNot) {
  enum class Closed { no, by_its_last_chunk, by_order };
  for (const Closed closed : {Closed::no, Closed::by_its_last_chunk, Closed::by_order}) {
    StartedStation station(watched(Stale::halt));
    UntypedFrontend frontend("pair");
    const std::array<std::uint32_t, 1> actuator{0};
    const std::array<std::uint32_t, 2> due{1, 2};
    const std::array<double, 2> rows{};
    frontend.add_chunk(
        actuator, due, std::as_bytes(std::span(rows)),
        {.anchor = frontend.published(), .plan = 1, .final = closed == Closed::by_its_last_chunk});
    if (closed == Closed::by_order) frontend.add_close_plan(1);
    const Batch batch = frontend.pulse();
    station.run(3);
    EXPECT_EQ(batch.handle(0).status, Status::completed);
    EXPECT_EQ(frontend.latest().starved(0), closed == Closed::no);
    EXPECT_FALSE(frontend.latest().starved(1));
    EXPECT_FALSE(frontend.halted());
    station.run(4);
    ASSERT_EQ(frontend.halted().has_value(), closed == Closed::no);
    if (closed != Closed::no) continue;
    EXPECT_EQ(frontend.halted()->iteration, 7);
    EXPECT_FALSE(frontend.latest().starved(0));
    EXPECT_EQ(frontend.latest().head().starvations, 1);
  }
}

// rule W7
TEST_F(SilenceTest, CountsPeriodsThatTheLoopMissedAfterWhatCameMeanwhile) {
  StartedStation station(watched(Stale::purge, 50));
  UntypedFrontend silent("pair");
  UntypedFrontend lively("pair");
  const Batch batch = send(silent, 0, 1000.0, {.pace = iterations(1000)});
  const Batch other = send(lively, 1, 1000.0, {.pace = iterations(1000)});
  station.run(5);
  const double before = desired(silent.latest());
  station.backend.set_timing({.skipped = 100});
  station.run(1);
  EXPECT_EQ(desired(silent.latest()), before + 1.0) << "a plan counts no missed periods";
  lively.keep_alive();
  const auto grace = static_cast<int>(10'000'000 / station.backend.schema().head.period) + 2;
  station.run(grace);
  EXPECT_EQ(batch.handle(0).status, Status::purged);
  EXPECT_EQ(batch.handle(0).reason, Reason::silence);
  EXPECT_EQ(other.handle(0).status, Status::active) << "its sign of life came after the gap";
  station.run(30);
  EXPECT_EQ(other.handle(0).status, Status::active);
}

TEST_F(SilenceTest, CountsNoPeriodsThatWereMissedWhileHalted) {
  StartedStation station(watched(Stale::purge, 50));
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  holder.add_take_control();
  holder.pulse();
  station.run(2);
  const std::uint64_t number = other.halt("");
  station.run(2);
  station.backend.set_timing({.skipped = 1000});
  station.run(2);
  const Batch resume = send_resume(other, number);
  station.run(20);
  EXPECT_EQ(resume.handle(0).status, Status::completed);
  const Batch refused = send(other, 0, 1.0);
  station.run(1);
  EXPECT_EQ(refused.rejected_by(), Reason::exclusive) << "the holder has kept its control";
}

// rule W4
TEST_F(SilenceTest, EndsWhatTheSilentCommanderHasScheduled) {
  StartedStation station(watched(Stale::purge));
  UntypedFrontend silent("pair");
  UntypedFrontend lively("pair");
  send(silent, 0, 100.0, {.pace = iterations(100)});
  add(silent, 1, 5.0);
  silent.add_take_control();
  const Batch later = silent.pulse({.at = 20});
  add(lively, 1, 3.0);
  const Batch others = lively.pulse({.at = 20});
  station.run(7);
  EXPECT_EQ(later.handle(0).status, Status::purged);
  EXPECT_EQ(later.handle(0).reason, Reason::silence);
  EXPECT_EQ(later.handle(0).iteration, 7) << "when the silence is noticed, not when it was due";
  EXPECT_EQ(later.handle(1).status, Status::purged);
  station.run(14);
  EXPECT_EQ(others.handle(0).status, Status::completed);
  EXPECT_EQ(desired(lively.latest(), 1), 3.0) << "what others scheduled acts";
  // its sender is free to begin again
  EXPECT_EQ(desired(silent.latest(), 0), 6.0);
  send(silent, 0, 1.0);
  station.run(1);
  EXPECT_EQ(desired(silent.latest(), 0), 1.0);
}

TEST_F(SilenceTest, AHaltEndsItTooAlsoWhatAHaltWouldLeave) {
  StartedStation station(watched(Stale::halt));
  UntypedFrontend silent("pair");
  send(silent, 0, 100.0, {.pace = iterations(100)});
  add(silent, 1, 5.0);
  const Batch command = silent.pulse({.at = 20});
  add_request(silent, Reset{.seed = 9});  // is served while halted
  const Batch request = silent.pulse({.at = 20});
  station.run(7);
  ASSERT_TRUE(silent.halted());
  EXPECT_EQ(command.handle(0).status, Status::halted);
  EXPECT_EQ(request.handle(0).status, Status::purged);
  EXPECT_EQ(request.handle(0).reason, Reason::silence);
}

TEST_F(SilenceTest, StopsIfToldSo) {
  StartedStation station(watched(Stale::stop));
  UntypedFrontend frontend("pair");
  send(frontend, 0, 100.0, {.pace = iterations(100)});
  for (int i = 0; i < 20 && station.iterate() == Step::run; ++i) {
  }
  EXPECT_THAT(std::string(station.backend.failure()),
              HasSubstr("longer than the watchdog (silence) allows"));
  EXPECT_LE(station.last(), 8);
}

TEST_F(SilenceTest, HaltsIfToldSo) {
  StartedStation station(watched(Stale::halt));
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 100.0, {.pace = iterations(100)});
  station.run(7);
  EXPECT_EQ(batch.handle(0).status, Status::halted);
  EXPECT_EQ(batch.handle(0).iteration, 7) << "in the very iteration in which it was noticed";
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->cause, HaltCause::silence);
  EXPECT_THAT(std::string(frontend.halted()->reason()), HasSubstr("pid "));
}

TEST_F(SilenceTest, BatchesOfAnotherFrontendAreNoLife) {
  StartedStation station(watched(Stale::purge));
  UntypedFrontend silent("pair");
  UntypedFrontend lively("pair");
  const Batch batch = send(silent, 0, 100.0, {.pace = iterations(100)});
  for (int i = 0; i < 8; ++i) {
    send(lively, 1, i);
    station.run(1);
  }
  EXPECT_EQ(batch.handle(0).status, Status::purged);
  EXPECT_EQ(desired(lively.latest(), 1), 7.0) << "those of the other go on";
}

TEST_F(SilenceTest, RejectedBatchesAreLifeOfTheirSenderOnly) {
  StartedStation station(watched(Stale::purge));
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  holder.add_take_control();
  add(holder, 0, 100.0, {.pace = iterations(100)});
  const Batch batch = holder.pulse();
  for (int i = 0; i < 8; ++i) {
    send(other, 1, i);
    station.run(1);
  }
  EXPECT_EQ(batch.handle(1).status, Status::purged);
}

TEST_F(SilenceTest, ControlIsSomethingThatActsAndEnds) {
  StartedStation station(watched(Stale::purge));
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  holder.add_take_control();
  holder.pulse();
  station.run(3);
  const Batch refused = send(other, 0, 1.0);
  station.run(1);
  EXPECT_EQ(refused.handle(0).reason, Reason::exclusive);
  station.run(4);
  const Batch taken = send(other, 0, 1.0);
  station.run(1);
  EXPECT_EQ(taken.handle(0).status, Status::completed);
}

// rule W2
TEST_F(SilenceTest, KeepAliveAndPulsesAreLife) {
  StartedStation station(watched(Stale::purge));
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 100.0, {.pace = iterations(100)});
  for (int i = 0; i < 5; ++i) {
    station.run(5);
    frontend.keep_alive();
  }
  EXPECT_EQ(batch.handle(0).status, Status::active);
  for (int i = 0; i < 5; ++i) {
    station.run(5);
    send(frontend, 1, i);
  }
  EXPECT_EQ(batch.handle(0).status, Status::active);
}

TEST_F(SilenceTest, LifeCountsFromWhenItWasShown) {
  StartedStation station(watched(Stale::purge, 10));
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 100.0, {.pace = iterations(100)});
  station.run(4);
  frontend.keep_alive();  // it knows row 4
  station.run(10);
  EXPECT_EQ(batch.handle(0).status, Status::active);
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::purged);
  EXPECT_EQ(batch.handle(0).iteration, 15);
}

// rule W2
TEST_F(SilenceTest, ReadingIsNoLife) {
  StartedStation station(watched(Stale::purge));
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 100.0, {.pace = iterations(100)});
  for (int i = 0; i < 8; ++i) {
    station.run(1);
    frontend.latest();
    frontend.wait_for(station.last(), kPatience);
    frontend.halted();
    batch.handle(0);
  }
  EXPECT_EQ(batch.handle(0).status, Status::purged);
}

// rule W2
TEST_F(SilenceTest, AWaitForOnesOwnBatchIsLife) {
  StartedStation station(watched(Stale::purge, 3));
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 20.0, {.pace = iterations(20)});
  // each look of a wait that does not wait
  while (!batch.ended()) {
    station.run(1);
    EXPECT_THROW(batch.wait(kAtOnce), TimeoutError);
    if (station.last() > 18) break;
  }
  EXPECT_EQ(batch.handle(0).status, Status::active);
}

TEST_F(SilenceTest, NothingThatActsNoSilence) {
  StartedStation station(watched(Stale::stop));
  UntypedFrontend frontend("pair");
  send(frontend, 0, 1.0);
  station.run(50);
  const Batch batch = send(frontend, 0, 100.0, {.pace = iterations(100)});
  station.run(5);
  EXPECT_EQ(batch.handle(0).status, Status::active) << "nor is the time before counted";
}

// rule W3
TEST_F(SilenceTest, ABurstIsItsSendersLifeAndStandingStillCountsNone) {
  BackendOptions options = watched(Stale::purge);
  options.bursting = true;
  StartedStation station(options);
  UntypedFrontend frontend("pair");
  add(frontend, 0, 100.0, {.pace = iterations(100)});
  const Burst burst = frontend.start_burst(50);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(burst.batch().handle(0).status, Status::active);
  EXPECT_EQ(station.drive(), Step::standing);
  frontend.start_burst(10);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(burst.batch().handle(0).status, Status::active);
}

TEST_F(SilenceTest, AnothersBurstIsNot) {
  BackendOptions options = watched(Stale::purge);
  options.bursting = true;
  StartedStation station(options);
  UntypedFrontend silent("pair");
  UntypedFrontend other("pair");
  const Batch batch = send(silent, 0, 100.0, {.pace = iterations(100)});
  other.start_burst(20);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(batch.handle(0).status, Status::purged);
}

TEST_F(SilenceTest, LifeFromTheFutureIsThatOfNow) {
  StartedStation station(watched(Stale::purge));
  Liar liar;
  BatchBuilder builder;
  RecordHead head;
  head.pace = Pace::iterations;
  head.amount = 1000;
  const double target = 1000.0;
  builder.command(head, std::as_bytes(std::span(&target, 1)));
  BatchRecord batch;
  batch.id = liar.sender().next_id();
  liar.sender().draw_ids(batch.id + 3);
  liar.send(builder, batch);
  liar.page().life = std::numeric_limits<std::int64_t>::max();
  station.run(10);
  EXPECT_TRUE(UntypedFrontend("pair").latest().active(0)) << "it may say what it likes";
  liar.page().life = std::numeric_limits<std::int64_t>::min();
  station.run(10);
  EXPECT_FALSE(UntypedFrontend("pair").latest().active(0)) << "but has to go on saying it";
}

/// As a driver would with `o80::rests_at(0)`: what is commanded are velocities.
void rest_at_zero(Schema& schema) {
  schema.limits.at(schema.actuators.at(0).first_limit).resting = 1;
}

// rule W1
TEST_F(SilenceTest, ADirectValueThatStillActsCountsAlthoughNothingIsQueued) {
  StartedStation station(watched(Stale::purge), rest_at_zero);
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 3.0);
  station.run(6);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
  EXPECT_EQ(desired(frontend.latest()), 3.0) << "a streamed velocity stays until the next one";
  station.run(1);
  EXPECT_EQ(desired(frontend.latest()), 0.0) << "but not when its sender hangs";
}

// rule W6
TEST_F(SilenceTest, WithoutAWatchdogADirectValueThatDoesNotRestIsRefused) {
  StartedStation station({.segment = "pair"}, rest_at_zero);
  UntypedFrontend frontend("pair");
  EXPECT_THAT(message_of<InvalidArgument>([&] { add(frontend, 0, 3.0); }),
              AllOf(HasSubstr("actuator 'shoulder'"), HasSubstr("--silence")));
  add(frontend, 0, 0.0);
  add(frontend, 0, 3.0, {.pace = iterations(5)});
  add(frontend, 1, 3.0);
  EXPECT_EQ(frontend.added(), 3U) << "its rest, another pace, an actuator that has no rest";
}

TEST_F(SilenceTest, ASimulationNeedsNoWatchdog) {
  StartedStation station({.segment = "pair", .bursting = true}, rest_at_zero);
  UntypedFrontend frontend("pair");
  add(frontend, 0, 3.0);
  EXPECT_EQ(frontend.added(), 1U);
}

TEST_F(SilenceTest, TheSchemaTellsFrontends) {
  StartedStation station(watched(Stale::halt, 7));
  const UntypedFrontend frontend("pair");
  EXPECT_EQ(frontend.schema().head.silence, 7);
  EXPECT_EQ(frontend.schema().head.stale, Stale::halt);
}

// rule W4
TEST_F(SilenceTest, HaltsUnlessAnotherPolicyIsAskedFor) {
  const Station watched_station({.segment = "watched", .silence = 7});
  const Station other({.segment = "other"});

  EXPECT_EQ(watched_station.backend.schema().head.stale, Stale::halt);
  EXPECT_EQ(other.backend.schema().head.stale, Stale::hold);
}

// rule W5
TEST_F(SilenceTest, ADeadCommanderHaltsIfToldSo) {
  StartedStation station({.segment = "pair", .stale = Stale::halt});
  StandingProcess child([](const StandingProcess::Stand& stand) {
    UntypedFrontend frontend("pair");
    send(frontend, 0, 1e6, {.pace = iterations(1'000'000)});
    stand();
  });
  station.run(2);
  child.kill_now();
  UntypedFrontend frontend("pair");
  station.run_until([&] { return frontend.halted().has_value(); });
  EXPECT_EQ(frontend.halted()->cause, HaltCause::dead_frontend);
}

}  // namespace
}  // namespace o80::test
