// Halts at iteration level: when they act, what they end and what is refused.

#include "runtime/hostile_frontend.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using HaltTest = ManualBackendTest;

// rules H3, H6
TEST_F(HaltTest, ActsInTheFirstStepBegunAfterIt) {
  Trace trace({.segment = "pair"});
  trace.play(R"(0 to 10 over 10; 0 to 20; a = pulse; run 3; B: halt the ball is on the floor
    halted @-1; run 2; a halted @4; a.1 halted  # requested, not acting yet; then in force
    0 rows 3: 3 3 3  # a position without limits stops in one iteration
    row 3 free; row 4 halted; row 5 halted; halted frontend @4 why the ball is on the floor)");
  for (const FrontendOptions& options : {FrontendOptions{}, {.access = Access::read_only}}) {
    const auto halt = UntypedFrontend("pair", options).halted();
    ASSERT_TRUE(halt);
    EXPECT_EQ(halt->number, 1U);
    EXPECT_EQ(halt->iteration, 4);
    EXPECT_THAT(std::string(halt->who_text()), HasSubstr("pid " + std::to_string(getpid())));
  }
}

TEST_F(HaltTest, AReadOnlyFrontendMayNotHalt) {
  StartedBackend manual;
  UntypedFrontend reader("pair", {.access = Access::read_only});
  EXPECT_THROW(reader.halt("no"), ReadOnly);
  EXPECT_FALSE(reader.halted());
}

// rule H7
TEST_F(HaltTest, CommandsAreRejectedWithCauseIterationAndWho) {
  play(R"(halt enough; run 1; a = 0 to 5; run 1; a rejected halted; a says since iteration 1
    a says cause frontend; a says enough; a says pid )" +
       std::to_string(getpid()) + "; a raises BackendHalted; 0 is 0");
}

TEST_F(HaltTest, NoRequestIsServedThatWasSentAfterAHaltInTheSameStep) {
  play("while refused halt; while refused a = break; b = refuse at 2; run 2; a halted");
}

// rule H4
TEST_F(HaltTest, EndsWhatWasSentBeforeItWhereverItIs) {
  std::string large;  // staged over several iterations
  for (int i = 0; i < 3000; ++i) large += "B: 1 to " + std::to_string(i) + ";";
  play("a = 0 to 9 over 9; b = 1 to 1 at 20;" + large + R"(B: large = pulse; run 2; c = 1 to 7; halt
    run 1; a halted; b halted @3; run 20; c halted; 1 is 0; large halted; large.2999 halted)");
}

TEST_F(HaltTest, WhatWasSentBeforeItNeverActsAlsoAfterTheResume) {
  auto [manual, frontend] = StartedPair();
  send(frontend, 1, 0.0);
  frontend.halt("");
  manual.run(1);
  // drawn before the halt acts, committed long after
  HostileFrontend sender;
  const CommandId id = sender.draw_id();
  const Batch resumed = send_resume(frontend, 1);
  manual.run(1);
  EXPECT_EQ(resumed.handle(0).status, Status::completed) << resumed.handle(0).text;
  EXPECT_FALSE(frontend.halted());
  sender.command(4.0, {.id = id});
  // as if its ticket had been drawn before the halt
  const std::uint64_t early = 0;
  const auto lane = sender.sender().lane();
  auto* words = reinterpret_cast<std::uint64_t*>(sender.view().transport(lane));
  std::atomic_ref(words[offsetof(BatchRecord, ticket) / 8]).store(early);
  manual.run(2);
  EXPECT_EQ(sender.status(record_id(id, 0)), Status::halted);
  EXPECT_EQ(desired(frontend.latest()), 0.0);
}

// rule H1
TEST_F(HaltTest, NobodysExclusiveControlStopsIt) {
  play(R"(take; 0 to 9 over 9; a = pulse; run 2; B: halt; run 1; a.1 halted)");
}

// rule H1
TEST_F(HaltTest, NeedsNoLane) {
  play({.segment = "pair", .lanes = 1}, "a = 0 to 9 over 9; run 1; B: halt; run 1; a halted");
}

// rule H3
TEST_F(HaltTest, IsLatchedBeforeRowZero) {
  ManualBackend manual;
  halt("pair", "not today", kPatience);
  manual.start();
  UntypedFrontend frontend("pair");
  EXPECT_EQ(frontend.latest().head().halted, 1U);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->reason(), "not today");
}

TEST_F(HaltTest, IsTheBackendsOwnTooAndOnceForEachCause) {
  play(R"(driver halts motor 3 is hot; run 1; driver halts motor 3 is hot; run 1
    halted driver @1 why motor 3 is hot; r = resume 1; run 1; running)");
}

// rule H8
TEST_F(HaltTest, OfTheBackendForAnotherReasonIsAnotherOne) {
  play(R"(driver halts the belt slipped; run 1; driver halts a person; run 1; driver halts a person
    run 1; halted driver @2 why a person; r = resume 1; run 1; r rejected
    r says halt 2 came after it)");
}

TEST_F(HaltTest, AStatusBearsNoReasonOfALaterHalt) {
  play(R"(a = 0 to 9 over 9; run 2; halt the first; run 1; b = 0 to 1; run 1; r = resume 1; run 1
    c = 0 to 9 over 9; run 2; halt the second; run 1
    a halted halted; a says the backend was halted  # by which one is no longer known
    b rejected halted; b says the backend was halted; c says the second
    halt the third; d = 0 to 1; d queued; run 1; d says the third  # not acting before the step)");
}

// rule L8
TEST_F(HaltTest, ARobotThatIsNotWhereItShouldBeHalts) {
  play({.segment = "pair"},
       R"(a = 1 to 1 over 10; in 3 read 1 0.75; run 4; halted error @4; a halted
    a says observed at 0.75; a says desired at 0.3)",
       [](Schema& schema) { schema.actuator(1).limits({.error = 0.25}); });
}

TEST_F(HaltTest, AReadingThatIsNoNumberHaltsWhereThereIsAnErrorLimit) {
  play({.segment = "pair"}, "in 1 read 1 nan; run 2; halted error",
       [](Schema& schema) { schema.actuator(1).limits({.error = 1e9}); });
}

// ------------------------------------------------------------------------------ bursts

// rule H5
TEST_F(HaltTest, AHaltEndsABurstAfterTheIterationUnderWay) {
  for (const std::string sent : {"a = to end", "a = burst 100"}) {
    play_bursts("0 to 100 over 100;" + sent + R"(; in 5 driver halts five; drive
      last 5; halted driver @6 why five; a halted  # in the next one, that has not begun)");
  }
  BurstingBackend bursting("pair", [](ManualBackend& manual) {
    manual.before_publish = [&manual] {
      if (manual.backend.iteration() == 5) manual.backend.halt(HaltCause::driver, "five");
    };
  });
  EXPECT_THAT(message_of<BackendHalted>([] { UntypedFrontend("pair").burst(100, kPatience); }),
              AllOf(HasSubstr("ended in iteration 5"), HasSubstr("five")));
}

// rule H7
TEST_F(HaltTest, BurstsAreServedWhileHalted) {
  play_bursts(R"(halt; a = burst 3; drive; a done 3; row 3 halted; 0 to 1; b = burst 1; drive
    b rejected halted; last 3; r = resume 1; drive; r completed; running
    0 to 1; c = burst 1; drive; c done 5; 0 is 1)");
}

TEST_F(HaltTest, AHaltIsSeenByABackendThatStandsStill) {
  play_bursts("0 to 9 over 9; burst 2; a = 0 to 3; halt; drive; a halted; a raises BackendHalted");
}

}  // namespace
}  // namespace o80::test
