// A burst ends early for its own sender: its cancel, its close, a wait that it gives up. A group of
// bursts begins whole or not at all.

#include <optional>
#include <string>
#include <vector>

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using BurstCancelTest = ManualBackendTest;

// rule G3
TEST_F(BurstCancelTest, ACancelledBurstEndsAfterTheIterationUnderWay) {
  play_bursts(
      "a = burst 1e15; run 3; in 4 cancel a; run 1; drive; a done 4; b = burst 2; drive; b done 6");
}

TEST_F(BurstCancelTest, OneThatHasNotBegunRunsNoIterationAndNoOtherIsTouched) {
  play_bursts(
      R"(a = burst 3; b = burst 1e9; c = burst 2; cancel b; drive; a done 3; b done 3; c done 5)");
}

// rule G3
TEST_F(BurstCancelTest, WhatWasSentWithItStaysQueued) {
  play_bursts(
      R"(0 to 8 over 8; a = burst 1000; run 2; cancel a; drive; a active; burst 6; a completed)");
}

TEST_F(BurstCancelTest, ItEndsWhenItsSenderCloses) {
  play_bursts("B: a = burst 1e15; run 2; B: close; drive; last 2");
}

// rule G3
TEST_F(BurstCancelTest, AnotherFrontendEndsItByNeitherCloseNorPurge) {
  play_bursts(R"(B: b = purge own; a = burst 5; run 2; B: c = purge; run 1
    c taken -1  # nothing sent later acts in a burst
    B: close; run 2; drive; last 5; c taken 6  # before the next one)");
}

TEST_F(BurstCancelTest, TheRestIsCancelledWhenTheCallGivesUpItsWait) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .bursting = true});
  EXPECT_THROW(frontend.burst(1'000'000, kAtOnce), TimeoutError);
  EXPECT_THROW(frontend.burst(1'000'000, kPatience, [] { return false; }), Cancelled);
  add(frontend, 0, 1.0, {.pace = iterations(1'000'000)});
  EXPECT_THROW(frontend.pulse_and_wait(kAtOnce), TimeoutError);
  std::vector<std::byte> rows(5 * std::size_t{frontend.layout().size});
  EXPECT_THROW(frontend.burst_rows(rows, kAtOnce), TimeoutError);
  EXPECT_EQ(manual.drive(), Step::standing);
  EXPECT_EQ(manual.last(), 0) << "none had begun";
}

TEST_F(BurstCancelTest, ABurstThatWasStartedCanBeWaitedForAgainAfterATimeout) {
  play_bursts("a = burst 4; a raises TimeoutError; drive; a done 4; a waits");
}

// ------------------------------------------------------------------------------ groups

class BurstGroupTest : public ManualBackendTest {
 protected:
  StartedBackend manual{{.segment = "pair", .bursting = true}};
};

// rule G5
TEST_F(BurstGroupTest, NoMemberOfAGroupMovesIfOneCannot) {
  UntypedFrontend frontend("pair");
  add(frontend, 0, 1.0);  // goes with no burst that is refused
  const auto refused_with = [&](UntypedFrontend& other, std::int64_t iterations) {
    const BurstMember group[] = {{&frontend, 5}, {&other, iterations}};
    std::string message;
    try {
      burst(group, kAtOnce);
    } catch (const Error& error) {
      message = error.what();
    }
    EXPECT_NE(message, "");
    EXPECT_EQ(manual.drive(), Step::standing);
    EXPECT_EQ(manual.last(), 0) << message;
    return message;
  };

  StartedBackend other({.segment = "other", .bursting = true, .lanes = 1, .lane_blocks = 16});
  UntypedFrontend second("other");
  EXPECT_THAT(refused_with(second, 0), HasSubstr("at least 1"));

  {  // no lane
    UntypedFrontend holder("other");
    holder.add_purge_own();
    holder.pulse();
    EXPECT_THAT(refused_with(second, 5), HasSubstr("lanes are taken"));
  }
  // no room
  for (int i = 0; i < 20; ++i) add(second, 0, 1.0);
  EXPECT_THAT(refused_with(second, 5), HasSubstr("blocks"));
  second.forget_added();
  {  // a clock of its own
    StartedBackend paced({.segment = "paced"});
    UntypedFrontend third("paced");
    EXPECT_THAT(refused_with(third, 5), HasSubstr("cannot be burst"));
  }
  // itself, twice
  EXPECT_THAT(refused_with(frontend, 5), HasSubstr("twice"));
  // gone
  other.backend.end(BackendState::stopped);
  EXPECT_THAT(refused_with(second, 5), HasSubstr("other"));
  EXPECT_EQ(frontend.pulse().size(), 1U);
}

class BurstGroupOfTwoTest : public BurstGroupTest {
 protected:
  StartedBackend other{{.segment = "other", .bursting = true}};
  UntypedFrontend first{"pair"};
  UntypedFrontend second{"other"};
};

TEST_F(BurstGroupOfTwoTest, ReturnsAtOnceWithEachItsOwnIterationsToWaitFor) {
  const BurstMember group[] = {{&first, 5}, {&second, 3}};
  const std::vector<Burst> bursts = start_bursts(group);
  ASSERT_EQ(bursts.size(), 2U);
  EXPECT_FALSE(bursts[0].done());
  manual.drive();
  EXPECT_TRUE(bursts[0].done());
  EXPECT_FALSE(bursts[1].done());
  other.drive();
  const std::vector<UntypedObservation> rows = wait_for(bursts, kAtOnce);
  EXPECT_EQ(rows[0].iteration(), 5);
  EXPECT_EQ(rows[1].iteration(), 3);
}

TEST_F(BurstGroupOfTwoTest, ThatIsNotDoneInTimeIsCancelledWhole) {
  const BurstMember group[] = {{&first, 1'000'000}, {&second, 1'000'000}};
  EXPECT_THROW(burst(group, kAtOnce), TimeoutError);
  manual.drive();
  other.drive();
  EXPECT_EQ(manual.last(), 0);
  EXPECT_EQ(other.last(), 0);
}

/// A group of two under way, whose second member has run two iterations and fails then.
class BurstGroupFailureTest : public BurstGroupOfTwoTest {
 protected:
  BurstGroupFailureTest() {
    const BurstMember group[] = {{&first, 1'000'000'000}, {&second, 1'000'000'000}};
    bursts = start_bursts(group);
    manual.run(3);
    other.run(2);
  }
  /// The wait raises an error of the second member that has this text, and cancels the first.
  template <class Expected>
  void expect_failure(const std::string& text, Timeout timeout = kPatience) {
    EXPECT_THAT(message_of<Expected>([&] { wait_for(bursts, timeout); }),
                AllOf(HasSubstr("'other'"), HasSubstr(text)));
    EXPECT_EQ(manual.drive(), Step::standing);
    EXPECT_EQ(manual.last(), 3);
  }

  std::vector<Burst> bursts;
};

TEST_F(BurstGroupFailureTest, AMemberThatHaltsIsNoticedWhileAnEarlierOneIsWaitedFor) {
  other.backend.halt(HaltCause::driver, "collision");
  other.drive();
  expect_failure<BackendHalted>("collision");
}

TEST_F(BurstGroupFailureTest, SoIsOneWhoseBackendEnds) {
  other.backend.end(BackendState::failed, "the motor burnt");
  expect_failure<BackendFailed>("the motor burnt");
}

TEST_F(BurstGroupFailureTest, SoIsOneWhoseFrontendIsClosed) {
  second.close();
  expect_failure<Closed>("");
}

TEST_F(BurstGroupFailureTest, ATimeoutDoesNotBlameAMemberThatStillRuns) {
  other.backend.halt(HaltCause::driver, "collision");
  other.drive();
  expect_failure<BackendHalted>("collision", kAtOnce);
}

TEST_F(BurstGroupFailureTest, WhatAMemberFinishedBeforeItEndedCounts) {
  const Burst done = second.start_burst(1);
  bursts[1].cancel();
  other.drive();
  EXPECT_EQ(done.wait_done(kAtOnce), 3);
  other.backend.end(BackendState::failed, "the motor burnt");
  EXPECT_THROW(wait_for(bursts, kAtOnce), TimeoutError) << "of the first";
}

}  // namespace
}  // namespace o80::test
