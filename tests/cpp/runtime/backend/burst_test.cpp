#include <atomic>

#include "memory/child_process.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using BurstTest = ManualBackendTest;

// rule G1
TEST_F(BurstTest, RunsExactlyAsManyIterationsAndReturnsTheLastRow) {
  BurstingBackend bursting;
  UntypedFrontend frontend("pair");
  EXPECT_EQ(frontend.burst(1, kPatience).iteration(), 1);
  EXPECT_EQ(frontend.burst(7, kPatience).iteration(), 8);
  EXPECT_EQ(frontend.published(), 8);
  EXPECT_THAT(message_of<TimeoutError>([&] { frontend.wait_for(9, kAtOnce); }),
              HasSubstr("waits for a burst"));
  EXPECT_THROW(frontend.burst(0, std::nullopt), InvalidArgument);
  EXPECT_THROW(frontend.burst(-3, std::nullopt), InvalidArgument);
}

// rule G2
TEST_F(BurstTest, WhatIsSentWithItActsFromItsFirstIteration) {
  play_bursts("0 to 3 over 3; a = burst 2; drive; 0 rows 1: 1 2; b = burst 5; drive; 0 is 3");
  play_bursts(R"(0 to 3; a = burst 4 at 3; drive; 0 rows 1: 0 0 3 3
    0 to 5; b = burst 4 at 3; drive; b rejected late; last 4  # what is rejected does not burst)");
}

TEST_F(BurstTest, OfMoreRowsThanTheHistoryKeepsIsAnErrorAtOnce) {
  BurstingBackend bursting;
  UntypedFrontend frontend("pair");
  const auto kept = static_cast<std::size_t>(frontend.link()->history.rows());
  std::vector<std::byte> rows((kept + 1) * frontend.layout().size);
  EXPECT_THAT(message_of<InvalidArgument>([&] { frontend.burst_rows(rows, kPatience); }),
              HasSubstr("do not fit into its history"));
  EXPECT_EQ(frontend.published(), 0);
}

// rule G2
TEST_F(BurstTest, NothingSentLaterActsInIt) {
  play_bursts(R"(a = burst 3; B: b = 0 to 1; drive; 0 rows 1: 0 0 0; a done 3
    b taken 4  # while it stands still
    burst 1; 0 is 1)");
}

TEST_F(BurstTest, TwoFrontendsBurstOneAfterTheOther) {
  play_bursts(R"(0 to 1; a = burst 2; B: 0 to 2; B: b = burst 3; drive; a done 2; b done 5
    0 rows 1: 1 1 2 2 2)");
}

TEST_F(BurstTest, StagesAllThatWasSentBeforeIt) {
  std::string many;
  for (int i = 1; i <= 5000; ++i) many += "0 to " + std::to_string(i) + ";";
  play_bursts(many + "a = pulse; B: b = burst 3; drive; a taken 1; 0 rows 1: 1 2 3; last 3");
}

// rule G4
TEST_F(BurstTest, AMovementIsBurstToItsEnd) {
  play_bursts("0 to 1 over 500; 1 to 1 over 700; a = to end; drive; a ended 700; 1 is 1; last 700");
}

TEST_F(BurstTest, ABatchThatEndsWithoutMotionNeedsNoIteration) {
  play_bursts(R"(burst 3; purge; a = to end; drive; a completed; last 3
    reset 4; b = to end; drive; b ended 4; row 4 fresh; 0 is 4
    c = burst 2; drive; c done 6  # the fresh row was none of them)");
}

TEST_F(BurstTest, AMovementThatIsInterruptedEndsItsBurstInThatRow) {
  play_bursts("0 to 9 over 9; a = to end; in 4 interrupt 0; drive; a interrupted @4; last 4");
}

// rule G1
TEST_F(BurstTest, OfABackendWithAClockOfItsOwnIsAnErrorAtOnce) {
  auto [manual, frontend] = StartedPair();
  EXPECT_THAT(message_of<NotBursting>([&] { frontend.burst(1, std::nullopt); }),
              HasSubstr("start it with bursting"));
  const std::pair<UntypedFrontend*, std::int64_t> group[] = {{&frontend, 1}};
  EXPECT_THROW(burst(group, std::nullopt), NotBursting);
}

TEST_F(BurstTest, OfAFrontendWithoutControlIsRejected) {
  play_bursts(
      R"(take; a = to end; drive; B: b = burst 1; drive; b done -1; B: 0 to 1; B: c = burst 1
    drive; c rejected exclusive; c says has exclusive control; d = burst 1; drive; d done 1)");
}

TEST_F(BurstTest, OfAGroupLetsAllRunBeforeItWaits) {
  // each of the two goes on only when the other has begun
  std::array<std::atomic<bool>, 2> begun{};
  const auto meet = [&](std::size_t me) {
    return [&, me](ManualBackend& manual) {
      manual.before_publish = [&, me] {
        begun[me] = true;
        while (!begun[1 - me]) std::this_thread::yield();
      };
    };
  };
  BurstingBackend left("left", meet(0));
  BurstingBackend right("right", meet(1));
  UntypedFrontend first("left");
  UntypedFrontend second("right");
  const std::pair<UntypedFrontend*, std::int64_t> group[] = {{&first, 5}, {&second, 3}};
  const std::vector<UntypedObservation> rows = burst(group, kPatience);
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].iteration(), 5);
  EXPECT_EQ(rows[1].iteration(), 3);
}

TEST_F(BurstTest, ThatIsRejectedBecauseTheBackendEndsSaysWhyItEnded) {
  const std::string later = "0 to 1; a = burst 5 at 3; run 1; a undone; ";
  play_bursts(later + "end stopped; a raises BackendStopped");
  play_bursts(later + "end failed the elbow is hot; a raises BackendFailed the elbow is hot");
}

TEST_F(BurstTest, AMovementIsNotCalledEndedWhenTheBackendStopsInIt) {
  play_bursts(R"(0 to 1 over 1e9; a = to end; run 3; end stopped; a raises BackendStopped
    a purged stopped)");
}

TEST_F(BurstTest, AFrontendThatDiesInABurstLeavesTheBackendUsable) {
  BurstingBackend bursting;
  StandingProcess child([](const StandingProcess::Stand& stand) {
    UntypedFrontend frontend("pair", {.timeout = kPatience});
    frontend.start_burst(1'000'000'000'000);
    frontend.wait_for(10, kPatience);
    stand();
  });
  child.kill_now();
  UntypedFrontend frontend("pair");
  const UntypedObservation row = frontend.burst(3, kPatience);
  EXPECT_EQ(frontend.published(), row.iteration()) << "it stands still again";
}

TEST_F(BurstTest, AStepWithinATimeGivesUpStanding) {
  StartedBackend manual({.segment = "pair", .bursting = true});
  EXPECT_EQ(manual.backend.step_within(0), Step::standing);
  EXPECT_EQ(manual.backend.step_within(1'000'000), Step::standing);
  UntypedFrontend frontend("pair");
  frontend.start_burst(1);
  EXPECT_EQ(manual.backend.step_within(1'000'000), Step::run);
}

TEST_F(BurstTest, ThatIsCutIsDoneAndTheNextOneBegins) {
  play_bursts("a = burst 100; b = burst 2; run 3; cut; a done 3; drive; b done 5");
}

}  // namespace
}  // namespace o80::test
