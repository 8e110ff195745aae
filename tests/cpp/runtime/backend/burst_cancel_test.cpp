// A burst ends early for its own sender: its cancel, its close, a wait that it gives up. A group of
// bursts begins whole or not at all.

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class BurstCancelTest : public StationTest {
 protected:
  StartedStation station{{.segment = "pair", .bursting = true}};
};

// rule G3
TEST_F(BurstCancelTest, ACancelledBurstEndsAfterTheIterationUnderWay) {
  UntypedFrontend frontend("pair");
  const Burst burst = frontend.start_burst(1'000'000'000'000'000);
  station.run(3);
  ASSERT_EQ(station.backend.try_step(), Step::run);
  burst.cancel();
  station.backend.publish();
  EXPECT_EQ(station.iterate(), Step::standing);
  EXPECT_EQ(burst.wait(kAtOnce).iteration(), 4);
  const Burst next = frontend.start_burst(2);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(next.wait(kAtOnce).iteration(), 6);
}

TEST_F(BurstCancelTest, OneThatHasNotBegunRunsNoIterationAndNoOtherIsTouched) {
  UntypedFrontend frontend("pair");
  const Burst first = frontend.start_burst(3);
  const Burst second = frontend.start_burst(1'000'000'000);
  const Burst third = frontend.start_burst(2);
  second.cancel();
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(first.wait(kAtOnce).iteration(), 3);
  EXPECT_EQ(second.wait(kAtOnce).iteration(), 3);
  EXPECT_EQ(third.wait(kAtOnce).iteration(), 5);
}

// rule G3
TEST_F(BurstCancelTest, WhatWasSentWithItStaysQueued) {
  UntypedFrontend frontend("pair");
  add(frontend, 0, 8.0, {.pace = iterations(8)});
  const Burst burst = frontend.start_burst(1000);
  station.run(2);
  burst.cancel();
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(burst.batch().handle(0).status, Status::active);
  frontend.start_burst(6);
  station.drive();
  EXPECT_EQ(burst.batch().handle(0).status, Status::completed);
}

TEST_F(BurstCancelTest, ItEndsWhenItsSenderCloses) {
  std::optional<UntypedFrontend> frontend("pair");
  frontend->start_burst(1'000'000'000'000'000);
  station.run(2);
  frontend.reset();
  EXPECT_EQ(station.iterate(), Step::standing);
  EXPECT_EQ(station.last(), 2);
}

// rule G3
TEST_F(BurstCancelTest, AnotherFrontendEndsItByNeitherCloseNorPurge) {
  UntypedFrontend frontend("pair");
  std::optional<UntypedFrontend> other("pair");
  other->add_purge_own();
  other->pulse();
  frontend.start_burst(5);
  station.run(2);
  other->add_purge();
  const Batch purge = other->pulse();
  station.run(1);
  EXPECT_EQ(purge.first_iteration(), -1) << "nothing sent later acts in a burst";
  other.reset();
  station.run(2);
  EXPECT_EQ(station.iterate(), Step::standing);
  EXPECT_EQ(purge.first_iteration(), 6) << "before the next one";
}

TEST_F(BurstCancelTest, TheRestIsCancelledWhenTheCallGivesUpItsWait) {
  UntypedFrontend frontend("pair");
  EXPECT_THROW(frontend.burst(1'000'000, kAtOnce), TimeoutError);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(station.last(), 0) << "it had not begun";

  EXPECT_THROW(frontend.burst(1'000'000, kPatience, [] { return false; }), Cancelled);
  EXPECT_EQ(station.drive(), Step::standing);

  add(frontend, 0, 1.0, {.pace = iterations(1'000'000)});
  EXPECT_THROW(frontend.pulse_and_wait(kAtOnce), TimeoutError);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(station.last(), 0);

  std::vector<std::byte> rows(5 * std::size_t{frontend.layout().size});
  EXPECT_THROW(frontend.burst_rows(rows, kAtOnce), TimeoutError);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(station.last(), 0);
}

TEST_F(BurstCancelTest, ABurstThatWasStartedCanBeWaitedForAgainAfterATimeout) {
  UntypedFrontend frontend("pair");
  const Burst burst = frontend.start_burst(4);
  EXPECT_THROW(burst.wait(kAtOnce), TimeoutError);
  EXPECT_EQ(station.drive(), Step::standing);
  EXPECT_EQ(burst.wait(kAtOnce).iteration(), 4);
}

// ------------------------------------------------------------------------------ groups

// rule G5
TEST_F(BurstCancelTest, NoMemberOfAGroupMovesIfOneCannot) {
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
    EXPECT_EQ(station.drive(), Step::standing);
    EXPECT_EQ(station.last(), 0) << message;
    return message;
  };

  StartedStation other({.segment = "other", .bursting = true, .lanes = 1, .lane_blocks = 16});
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
    StartedStation paced({.segment = "paced"});
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

TEST_F(BurstCancelTest, AGroupReturnsAtOnceWithEachItsOwnIterationsToWaitFor) {
  StartedStation other({.segment = "other", .bursting = true});
  UntypedFrontend first("pair");
  UntypedFrontend second("other");
  const BurstMember group[] = {{&first, 5}, {&second, 3}};
  const std::vector<Burst> bursts = start_bursts(group);
  ASSERT_EQ(bursts.size(), 2U);
  EXPECT_FALSE(bursts[0].done());
  station.drive();
  EXPECT_TRUE(bursts[0].done());
  EXPECT_FALSE(bursts[1].done());
  other.drive();
  const std::vector<UntypedObservation> rows = wait_for(bursts, kAtOnce);
  EXPECT_EQ(rows[0].iteration(), 5);
  EXPECT_EQ(rows[1].iteration(), 3);
}

TEST_F(BurstCancelTest, AGroupThatIsNotDoneInTimeIsCancelledWhole) {
  StartedStation other({.segment = "other", .bursting = true});
  UntypedFrontend first("pair");
  UntypedFrontend second("other");
  const BurstMember group[] = {{&first, 1'000'000}, {&second, 1'000'000}};
  EXPECT_THROW(burst(group, kAtOnce), TimeoutError);
  station.drive();
  other.drive();
  EXPECT_EQ(station.last(), 0);
  EXPECT_EQ(other.last(), 0);
}

/// A group of two under way, whose second member has run two iterations and fails then.
class BurstGroupFailureTest : public BurstCancelTest {
 protected:
  BurstGroupFailureTest() {
    other.start();
    second.emplace("other");
    const BurstMember group[] = {{&first, 1'000'000'000}, {&*second, 1'000'000'000}};
    bursts = start_bursts(group);
    station.run(3);
    other.run(2);
  }
  /// The first member stands still again.
  void expect_the_first_cancelled() {
    EXPECT_EQ(station.drive(), Step::standing);
    EXPECT_EQ(station.last(), 3);
  }

  Station other{{.segment = "other", .bursting = true}};
  UntypedFrontend first{"pair"};
  std::optional<UntypedFrontend> second;
  std::vector<Burst> bursts;
};

TEST_F(BurstGroupFailureTest, AMemberThatHaltsIsNoticedWhileAnEarlierOneIsWaitedFor) {
  other.backend.halt(HaltCause::driver, "collision");
  other.drive();
  EXPECT_THAT(message_of<BackendHalted>([&] { wait_for(bursts, kPatience); }),
              AllOf(HasSubstr("'other'"), HasSubstr("collision")));
  expect_the_first_cancelled();
}

TEST_F(BurstGroupFailureTest, SoIsOneWhoseBackendEnds) {
  other.backend.end(BackendState::failed, "the motor burnt");
  EXPECT_THAT(message_of<BackendFailed>([&] { wait_for(bursts, kPatience); }),
              AllOf(HasSubstr("'other'"), HasSubstr("the motor burnt")));
  expect_the_first_cancelled();
}

TEST_F(BurstGroupFailureTest, SoIsOneWhoseFrontendIsClosed) {
  second->close();
  EXPECT_THAT(message_of<Closed>([&] { wait_for(bursts, kPatience); }), HasSubstr("'other'"));
  expect_the_first_cancelled();
}

TEST_F(BurstGroupFailureTest, ATimeoutDoesNotBlameAMemberThatStillRuns) {
  other.backend.halt(HaltCause::driver, "collision");
  other.drive();
  EXPECT_THAT(message_of<BackendHalted>([&] { wait_for(bursts, kAtOnce); }), HasSubstr("'other'"));
  expect_the_first_cancelled();
}

TEST_F(BurstGroupFailureTest, WhatAMemberFinishedBeforeItEndedCounts) {
  const Burst done = second->start_burst(1);
  bursts[1].cancel();
  other.drive();
  EXPECT_EQ(done.wait_done(kAtOnce), 3);
  other.backend.end(BackendState::failed, "the motor burnt");
  EXPECT_THROW(wait_for(bursts, kAtOnce), TimeoutError) << "of the first";
  expect_the_first_cancelled();
}

}  // namespace
}  // namespace o80::test
