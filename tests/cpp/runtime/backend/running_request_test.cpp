// Requests that take time: answered with `running`, ended some iterations later.

#include "memory/child_process.hpp"
#include "o80/runtime/typed_backend.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using RunningRequestTest = ManualBackendTest;

/// A request that runs since iteration 1.
Batch ask_home(UntypedFrontend& frontend, ManualBackend& manual) {
  add_request<Home>(frontend);
  Batch batch = frontend.pulse();
  manual.run(1);
  return batch;
}

// rule B10
TEST_F(RunningRequestTest, IsActiveUntilTheDriverEndsIt) {
  play(R"(a = home; run 3; a active @1; a open; a raises TimeoutError
    in 4 home ends; in 4 a active; run 1  # within: the row is not out
    a completed @4; a ended 4; a waits; fresh starts 0)");
}

TEST_F(RunningRequestTest, ShowsItsProgressToItsSenderAndToObservers) {
  play(R"(a = home; a shows; run 1; a shows looks for the index of joint 1
    home progress looks for the index of joint 2; a shows looks for the index of joint 2
    home ends; run 1; a shows; runs)");
  auto [manual, frontend] = StartedPair();
  ask_home(frontend, manual);
  const UntypedFrontend observer("pair", {.access = Access::read_only});
  ASSERT_EQ(observer.running_requests().size(), 1U);
  const RequestUnderWay seen = observer.running_requests()[0];
  EXPECT_EQ(seen.name, "home");
  EXPECT_EQ(seen.since, 1);
  EXPECT_THAT(seen.who, HasSubstr("pid " + std::to_string(getpid())));
  EXPECT_EQ(seen.progress, "looks for the index of joint 1");
}

TEST_F(RunningRequestTest, ALongProgressIsCut) {
  play("a = home; run 1; home progress " + std::string(1000, 'x') + "; a shows " +
       std::string(247, 'x') + "; home progress; a shows");
}

TEST_F(RunningRequestTest, MayEndAsRejectedWithItsReasonOrEndTheBackend) {
  play(R"(a = home; run 1; home ends rejected no index pulse within 20 s; run 1
    a rejected driver; a says no index pulse within 20 s; runs)");
  play(R"(a = home; run 1; home ends failed the gear broke; run 1; a rejected; ends
    fails the gear broke)");
}

TEST_F(RunningRequestTest, MayEndWithAFreshStart) {
  play(R"(moves = 0 to 5 over 100; a = home; run 2; in 3 read 0 -1; in 3 home ends afresh; run 1
    a active  # the fresh row is still to come
    run 1; fresh starts 1; a completed @4; moves purged fresh_start; row 4 fresh
    0 rows 4: -1 -1)");
}

TEST_F(RunningRequestTest, AFreshStartAtItsEndIsNoErrorOfTheRobot) {
  play({.segment = "pair"}, R"(a = home; run 1; in 2 read 0 -1; in 3 read 0 -1; in 4 read 0 -1
    in 2 home ends afresh; run 3; running  # the encoders have a new zero)",
       [](Schema& schema) { schema.actuator(0).limits({.error = 0.5}); });
}

TEST_F(RunningRequestTest, AReadingThatIsNoNumberFailsItsFreshStart) {
  play(R"(a = home; run 1; in 2 read 1 nan; in 2 home ends afresh; run 1; ends; a rejected
    a says is NaN or infinite)");
}

TEST_F(RunningRequestTest, ASecondOfItsKindIsRejectedBeforeItsHandlerIsAsked) {
  play(R"(a = home; run 2; B: b = home; run 1; homed 1; b rejected
    b says 'home' has been running since iteration 1: wait for its end; a active
    home ends; run 1; B: b = home; run 1; homed 2; b active @5)");
}

TEST_F(RunningRequestTest, AnotherKindIsServedBesideIt) {
  play(R"(a = home; run 1; b = calibrate; c = reset 9; run 1; c completed
    a active  # another one's fresh start does not end it
    runs home calibrate; calibrate ends; run 1; b completed; a active)");
}

TEST_F(RunningRequestTest, NeitherWhatFollowsItWaitsNorAPurgeEndsIt) {
  play("home; a = 0 to 5; run 1; a active; a.1 completed; b = purge; run 1; b completed; a active");
}

// rule B10
TEST_F(RunningRequestTest, AHaltEndsItAndADriverThatEndsItLaterChangesNothing) {
  play(R"(a = home; run 1; halt a hand in the cell; run 1; runs; a halted @2
    a says a hand in the cell; home ends rejected too late; run 1; a halted
    b = home; run 1; b rejected; r = resume 1; c = home; run 1; homed 2; c active)");
}

TEST_F(RunningRequestTest, AHaltWinsOverAFreshStartAtItsEnd) {
  play(R"(a = home; run 1; in 2 home ends afresh; run 1; halt; run 1; a halted
    fresh starts 0  # the resume starts afresh)");
}

TEST_F(RunningRequestTest, OneThatIsServedInHaltsContinuesInThem) {
  play(R"(a = calibrate; run 1; halt; run 1; a active; calibrate ends; run 1; a completed
    b = calibrate; run 1; r = resume 1; run 1; running; b active)");
}

TEST_F(RunningRequestTest, AnEndOfTheBackendEndsIt) {
  play("a = home; run 1; end stopped; a purged stopped; runs");
}

TEST_F(RunningRequestTest, AStopInOrderEndsItBeforeItBrakes) {
  play(R"(a = home; run 1; stop; ends; brakes  # the driver learns of it in this iteration
    runs; a purged)");
}

TEST_F(RunningRequestTest, ItContinuesWhenItsSenderCloses) {
  play(R"(B: b = home; run 1; B: close; c = 0 to 1; run 1; c completed; runs home
    home ends; run 1; runs)");
}

TEST_F(RunningRequestTest, ItContinuesWhenItsSenderIsKilledAndCommandsArePurged) {
  StartedBackend manual({.segment = "pair", .stale = Stale::purge});
  StandingProcess child([](const StandingProcess::Stand& stand) {
    UntypedFrontend frontend("pair");
    add_request<Home>(frontend);
    frontend.pulse();
    stand();
  });
  manual.run(1);
  ASSERT_EQ(manual.homed, 1);
  child.kill_now();
  // its death is seen when its lane has a new owner, whatever the helper thread has seen
  UntypedFrontend successor("pair");
  send(successor, 0, 1.0);
  manual.run(2);
  EXPECT_TRUE(manual.backend.runs_any());
}

TEST_F(RunningRequestTest, ItsSilentSenderIsHaltedByTheWatchdogUnlessItMovesNothing) {
  const BackendOptions watched{.segment = "pair", .stale = Stale::halt, .silence = 5};
  play(watched, "a = home; run 20; halted silence; a halted");
  play(watched, "a = calibrate; run 20; running; a active");
}

TEST_F(RunningRequestTest, ABackendThatIsReplacedWhileItRunsLeavesAHalt) {
  StandingProcess child([](const StandingProcess::Stand& stand) {
    auto [manual, frontend] = StartedPair();
    ask_home(frontend, manual);
    stand();
  });
  child.kill_now();
  play("run 1; halted predecessor  # the robot moved when its process was killed");
}

TEST_F(RunningRequestTest, ABurstUntilTheEndLastsUntilItsEndOrItsFreshStart) {
  play_bursts("home; a = to end; in 7 home ends; drive; last 7; row 7 free; a ended 7");
  play_bursts("home; a = to end; in 7 home ends afresh; drive; last 8; row 8 fresh; a ended 8");
  // and the fresh start needs no other burst
  play_bursts(R"(home; a = burst 3; in 3 home ends afresh; drive; a done 3; a completed; last 4)");
}

TEST_F(RunningRequestTest, ThousandsOfThemLeaveNoBlockBehind) {
  std::string many;
  for (int i = 0; i < 2000; ++i) many += "a = home; run 1; home ends; run 1; a completed;";
  play({.segment = "pair", .lane_blocks = 64}, many);
}

/// What the functions of Backend<R> add: names by type, and a halt that is reported after the end.
TEST_F(RunningRequestTest, IsNamedByItsTypeInATypedBackend) {
  Backend<Pair> backend({.segment = "pair"});
  backend.on<Home>([](const Home&) { return Served::running("looks"); });
  bool ran = true;
  backend.on_halt([&] { ran = backend.runs<Home>(); });
  backend.publish({});
  UntypedFrontend frontend("pair");
  const auto iterate = [&] {
    ASSERT_TRUE(backend.step());
    backend.publish({});
  };
  const auto ask = [&] {
    add_request<Home>(frontend);
    const Batch batch = frontend.pulse();
    iterate();
    return batch;
  };
  const Batch first = ask();
  EXPECT_TRUE(backend.runs<Home>());
  backend.progress<Home>("found");
  EXPECT_EQ(first.handle(0).progress, "found");
  backend.ended<Home>(Served::done());
  iterate();
  EXPECT_EQ(first.handle(0).status, Status::completed);
  ask();
  frontend.halt("");
  iterate();
  EXPECT_FALSE(ran) << "it ends before the driver is told of the halt";
}

}  // namespace
}  // namespace o80::test
