#include <atomic>

#include "memory/child_process.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

class BurstTest : public StationTest {};

/// A burst of thousands of millions is under way.
void wait_until_it_runs(const UntypedFrontend& frontend) {
  while (frontend.published() < 10) std::this_thread::yield();
}

// rule G1
TEST_F(BurstTest, RunsExactlyAsManyIterationsAndReturnsTheLastRow) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  EXPECT_EQ(frontend.burst(1, kPatience).iteration(), 1);
  EXPECT_EQ(frontend.burst(7, kPatience).iteration(), 8);
  EXPECT_EQ(frontend.published(), 8);
  EXPECT_THAT(message_of<TimeoutError>([&] { frontend.wait_for(9, kAtOnce); }),
              HasSubstr("waits for a burst"));
}

// rule G2
TEST_F(BurstTest, WhatIsSentWithItActsFromItsFirstIteration) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 3.0, {.pace = iterations(3)});
  const UntypedObservation row = frontend.burst(2, kPatience);
  EXPECT_EQ(desired(row), 2.0);
  EXPECT_EQ(observed(row), 2.0) << "the state after the action";
  EXPECT_EQ(desired(frontend.burst(5, kPatience)), 3.0);
}

TEST_F(BurstTest, WhatIsSentWithItMayActFromALaterIterationOfIt) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 3.0);
  frontend.burst(4, kPatience, {}, {.at = 3});
  EXPECT_THAT(desired(frontend, 1, 4), ElementsAre(0, 0, 3, 3));
  add(frontend, 0, 5.0);
  EXPECT_THAT(message_of<Error>([&] { frontend.burst(4, kPatience, {}, {.at = 3}); }),
              HasSubstr("after the iteration for which it was sent"));
  EXPECT_EQ(frontend.published(), 4) << "what is rejected does not burst";
}

TEST_F(BurstTest, GivesAllItsRowsIfAsked) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  const std::size_t size = frontend.layout().size;
  std::vector<std::byte> rows(3 * size);
  frontend.burst(2, kPatience);
  add(frontend, 0, 3.0, {.pace = iterations(3)});
  EXPECT_EQ(frontend.burst_rows(rows, kPatience), 5);
  const Rows expected = frontend.history(3, 5);
  EXPECT_THAT(rows, ElementsAreArray(expected.bytes));
}

TEST_F(BurstTest, OfMoreRowsThanTheHistoryKeepsIsAnErrorAtOnce) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  const auto kept = static_cast<std::size_t>(frontend.link()->history.rows());
  std::vector<std::byte> rows((kept + 1) * frontend.layout().size);
  EXPECT_THAT(message_of<InvalidArgument>([&] { frontend.burst_rows(rows, kPatience); }),
              HasSubstr("do not fit into its history"));
  EXPECT_EQ(frontend.published(), 0);
}

// rule G2
TEST_F(BurstTest, NothingSentLaterActsInIt) {
  StartedStation station({.segment = "pair", .bursting = true});
  UntypedFrontend one("pair");
  UntypedFrontend two("pair");
  const Burst burst = one.start_burst(3);
  const Batch later = send(two, 0, 1.0);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_THAT(desired(one, 1, 3), ElementsAre(0, 0, 0));
  EXPECT_EQ(burst.wait_done(kAtOnce), 3);
  EXPECT_EQ(later.first_iteration(), 4) << "taken while it stands still";
  one.start_burst(1);
  station.drive();
  EXPECT_EQ(desired(one.latest()), 1.0);
}

TEST_F(BurstTest, TwoFrontendsBurstOneAfterTheOther) {
  StartedStation station({.segment = "pair", .bursting = true});
  UntypedFrontend one("pair");
  UntypedFrontend two("pair");
  add(one, 0, 1.0);
  const Burst first = one.start_burst(2);
  add(two, 0, 2.0);
  const Burst second = two.start_burst(3);
  station.drive();
  EXPECT_EQ(first.wait_done(kAtOnce), 2);
  EXPECT_EQ(second.wait_done(kAtOnce), 5);
  EXPECT_THAT(desired(one, 1, 5), ElementsAre(1, 1, 2, 2, 2));
  EXPECT_TRUE(first.done());
}

TEST_F(BurstTest, StagesAllThatWasSentBeforeIt) {
  StartedStation station({.segment = "pair", .bursting = true});
  UntypedFrontend one("pair");
  UntypedFrontend two("pair");
  for (int i = 0; i < 5000; ++i) add(one, 0, i + 1);
  const Batch large = one.pulse();
  two.start_burst(3);
  station.drive();
  EXPECT_EQ(large.first_iteration(), 1);
  EXPECT_THAT(desired(one, 1, 3), ElementsAre(1, 2, 3));
  EXPECT_EQ(one.published(), 3);
}

// rule G4
TEST_F(BurstTest, AMovementIsBurstToItsEnd) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 1.0, {.pace = iterations(500)});
  add(frontend, 1, 1.0, {.pace = duration(std::chrono::milliseconds(700))});
  const UntypedObservation row = frontend.pulse_and_wait(kPatience);
  EXPECT_EQ(row.iteration(), 700);
  EXPECT_EQ(desired(row, 1), 1.0);
  EXPECT_EQ(frontend.published(), 700) << "and no further";
}

TEST_F(BurstTest, ABatchThatEndsWithoutMotionNeedsNoIteration) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  frontend.burst(3, kPatience);
  frontend.add_purge();
  EXPECT_EQ(frontend.pulse_and_wait(kPatience).iteration(), 3);
  add_request(frontend, Reset{.seed = 4});
  const UntypedObservation fresh = frontend.pulse_and_wait(kPatience);
  EXPECT_EQ(fresh.iteration(), 4);
  EXPECT_EQ(fresh.head().fresh, 1U);
  EXPECT_EQ(observed(fresh), 4.0);
  EXPECT_EQ(frontend.burst(2, kPatience).iteration(), 6) << "the fresh row was none of them";
}

TEST_F(BurstTest, AMovementThatIsInterruptedEndsItsBurstInThatRow) {
  StartedStation station({.segment = "pair", .bursting = true});
  UntypedFrontend frontend("pair");
  add(frontend, 0, 9.0, {.pace = iterations(9)});
  const Batch batch = frontend.pulse_to_end();
  station.before_publish = [&] {
    if (station.backend.iteration() == 4) station.backend.interrupt(0);
  };
  station.drive();
  EXPECT_EQ(batch.handle(0).status, Status::interrupted);
  try {
    frontend.wait_for_end(batch, kAtOnce);
    FAIL() << "it was interrupted";
  } catch (const NotCompleted& error) {
    EXPECT_THAT(error.what(), HasSubstr("'shoulder' was interrupted by the driver in iteration 4"));
    EXPECT_EQ(error.observation().iteration(), 4);
  }
  EXPECT_EQ(frontend.wait_for_end(batch, kAtOnce, {}, {.check = false}).iteration(), 4);
  EXPECT_EQ(frontend.published(), 4);
}

// rule G1
TEST_F(BurstTest, OfABackendWithAClockOfItsOwnIsAnErrorAtOnce) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  EXPECT_THAT(message_of<NotBursting>([&] { frontend.burst(1, std::nullopt); }),
              HasSubstr("start it with bursting"));
  const std::pair<UntypedFrontend*, std::int64_t> group[] = {{&frontend, 1}};
  EXPECT_THROW(burst(group, std::nullopt), NotBursting);
}

TEST_F(BurstTest, OfNoIterationIsAnErrorAtOnce) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  EXPECT_THROW(frontend.burst(0, std::nullopt), InvalidArgument);
  EXPECT_THROW(frontend.burst(-3, std::nullopt), InvalidArgument);
}

TEST_F(BurstTest, OfAFrontendWithoutControlIsRejected) {
  BurstingStation bursting;
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  holder.add_take_control();
  holder.pulse_and_wait(kPatience);
  EXPECT_THAT(message_of<Error>([&] { other.burst(1, kPatience); }),
              HasSubstr("has exclusive control"));
  const Burst rejected = other.start_burst(1);
  EXPECT_EQ(rejected.wait_done(kPatience), -1);
  EXPECT_TRUE(rejected.done());
  EXPECT_EQ(holder.burst(1, kPatience).iteration(), 1);
}

TEST_F(BurstTest, OfAGroupLetsAllRunBeforeItWaits) {
  // each of the two goes on only when the other has begun
  std::array<std::atomic<bool>, 2> begun{};
  const auto meet = [&](std::size_t me) {
    return [&, me](Station& station) {
      station.before_publish = [&, me] {
        begun[me] = true;
        while (!begun[1 - me]) std::this_thread::yield();
      };
    };
  };
  BurstingStation left("left", meet(0));
  BurstingStation right("right", meet(1));
  UntypedFrontend first("left");
  UntypedFrontend second("right");
  const std::pair<UntypedFrontend*, std::int64_t> group[] = {{&first, 5}, {&second, 3}};
  const std::vector<UntypedObservation> rows = burst(group, kPatience);
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].iteration(), 5);
  EXPECT_EQ(rows[1].iteration(), 3);
}

TEST_F(BurstTest, EndsWithAnErrorWhenTheBackendStopsInIt) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  const Burst burst = frontend.start_burst(1'000'000'000);
  wait_until_it_runs(frontend);
  bursting.stop();
  bursting.station.backend.end(BackendState::stopped);
  EXPECT_THROW(burst.wait(kPatience), BackendStopped);
  EXPECT_FALSE(burst.done());
}

TEST_F(BurstTest, ThatIsRejectedBecauseTheBackendEndsSaysWhyItEnded) {
  for (const BackendState state : {BackendState::stopped, BackendState::failed}) {
    StartedStation station({.segment = "pair", .bursting = true});
    UntypedFrontend frontend("pair");
    add(frontend, 0, 1.0);
    const Burst burst = frontend.start_burst(5, {.at = 3});
    ASSERT_EQ(station.iterate(), Step::run);
    station.backend.end(state, "the elbow is too hot");
    EXPECT_TRUE(burst.done());
    const auto wait = [&] { burst.wait(kPatience); };
    if (state == BackendState::stopped) {
      EXPECT_THROW(wait(), BackendStopped);
    } else {
      EXPECT_THAT(message_of<BackendFailed>(wait), ::testing::HasSubstr("the elbow is too hot"));
    }
  }
}

TEST_F(BurstTest, AMovementIsNotCalledEndedWhenTheBackendStopsInIt) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 1.0, {.pace = iterations(1'000'000'000)});
  const Batch batch = frontend.pulse_to_end();
  wait_until_it_runs(frontend);
  bursting.stop();
  bursting.station.backend.end(BackendState::stopped);
  EXPECT_THROW(frontend.wait_for_end(batch, kPatience), BackendStopped);
  EXPECT_THROW(batch.wait(kPatience), BackendStopped);
  EXPECT_EQ(batch.handle(0).status, Status::purged);
}

TEST_F(BurstTest, AFrontendThatDiesInABurstLeavesTheBackendUsable) {
  // the backend is made after the fork: a child has none of its parent's threads
  int gate[2];
  ASSERT_EQ(pipe(gate), 0);
  ChildProcess child([&](const ChildProcess::Ready& ready) {
    char byte = 0;
    if (read(gate[0], &byte, 1) != 1) return;
    UntypedFrontend frontend("pair", {.timeout = kPatience});
    frontend.start_burst(1'000'000'000'000);
    wait_until_it_runs(frontend);
    ready();
    pause_for_ever();
  });
  BurstingStation bursting;
  ASSERT_EQ(write(gate[1], "x", 1), 1);
  ASSERT_TRUE(child.wait_until_ready());
  child.kill_now();
  UntypedFrontend frontend("pair");
  const UntypedObservation row = frontend.burst(3, kPatience);
  EXPECT_EQ(frontend.published(), row.iteration()) << "it stands still again";
  ::close(gate[0]);
  ::close(gate[1]);
}

// rule G6
TEST_F(BurstTest, TwoRunsOfTheSameScriptGiveHistoriesIdenticalBitForBit) {
  const auto play = [] {
    BurstingStation bursting;
    UntypedFrontend frontend("pair");
    for (int i = 0; i < 20; ++i) {
      add(frontend, 0, 0.1 * i, {.pace = iterations(3), .profile = Profile::minimum_jerk});
      add(frontend, 1, 1.0 / (i + 1), {.pace = speed(30), .mode = Mode::overwrite});
      frontend.burst(1 + i % 7, kPatience);
    }
    return frontend.history(1'000'000).bytes;
  };
  const std::vector<std::byte> once = play();
  const std::vector<std::byte> again = play();
  ASSERT_GT(once.size(), 0U);
  EXPECT_EQ(once, again);
}

TEST_F(BurstTest, AStepWithinATimeGivesUpStanding) {
  StartedStation station({.segment = "pair", .bursting = true});
  EXPECT_EQ(station.backend.step_within(0), Step::standing);
  EXPECT_EQ(station.backend.step_within(1'000'000), Step::standing);
  UntypedFrontend frontend("pair");
  frontend.start_burst(1);
  EXPECT_EQ(station.backend.step_within(1'000'000), Step::run);
}

TEST_F(BurstTest, ThatIsCutIsDoneAndTheNextOneBegins) {
  StartedStation station({.segment = "pair", .bursting = true});
  UntypedFrontend frontend("pair");
  const Burst first = frontend.start_burst(100);
  const Burst second = frontend.start_burst(2);
  station.run(3);
  station.backend.cut_burst();
  EXPECT_EQ(first.wait(kAtOnce).iteration(), 3);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(second.wait(kAtOnce).iteration(), 5);
}

}  // namespace
}  // namespace o80::test
