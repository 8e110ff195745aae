#include "o80/runtime/batch.hpp"

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

class BatchTest : public ManualBackendTest {};

TEST_F(BatchTest, FollowsEachCommandFromQueuedToItsEnd) {
  play({.segment = "pair"}, R"(0 to 1 over 2; 0 to 2 over 2; 1 to 5  # too fast: one a millisecond
    0 to 3 until 1; a = pulse; a queued @-1; a taken -1; a open
    run 1; a active @1; a.1 queued; a.2 active  # a set-point continues until it is there
    run 1; a completed @2; run 1; a.1 active @3; a open; a ended -1
    run 2; a.3 rejected late; a.3 says came after; a ended 5; a waits 1 of 4)",
       [](Schema& schema) { schema.actuator(1).limits({.speed = 1000}); });
  auto [manual, frontend] = StartedPair();
  const Batch batch = send(frontend, 0, 1.0, {.pace = until(0)});
  manual.run(1);
  EXPECT_EQ(batch.handles().size(), 1U);
  EXPECT_THROW(batch.wait(kAtOnce), NotCompleted);
  batch.wait(kAtOnce, {}, {.check = false});
  EXPECT_THROW(static_cast<void>(batch.handle(1)), InvalidArgument);
}

// rule B11
TEST_F(BatchTest, TellsHowLateItsDecisionWas) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .history = 8, .lane_blocks = 16});
  manual.run(2);
  const UntypedObservation seen = frontend.latest();
  manual.run(3);
  EXPECT_EQ(frontend.pulse({.seen = seen}).id(), 0U) << "nothing was decided";
  EXPECT_EQ(send(frontend, 0, 1.0).decision_latency(), std::nullopt);
  add(frontend, 0, 1.0);
  const Batch batch = frontend.pulse({.seen = seen});
  const Seen row{frontend.epoch(), 2, seen.time(), seen.schema().head.clock, 2};
  EXPECT_EQ(batch.seen(), row);
  EXPECT_EQ(batch.size(), 1U);
  EXPECT_EQ(batch.decision_latency(), std::nullopt) << "it was not taken yet";
  manual.run(1);
  EXPECT_EQ(batch.decision_latency(), (DecisionLatency{4, frontend.latest().time() - seen.time()}));

  // a row of the future, of an unknown run, of one whose clock is another
  const auto latency_of = [&](Seen claimed) {
    add(frontend, 0, 1.0);
    const Batch sent = frontend.pulse({.seen = claimed});
    manual.run(1);
    return sent.decision_latency();
  };
  const Clock other = row.clock == Clock::simulated ? Clock::monotonic : Clock::simulated;
  EXPECT_EQ(latency_of({frontend.epoch(), 1'000'000, -1, row.clock}), DecisionLatency{});
  EXPECT_EQ(latency_of({77, 3, -1, row.clock}), DecisionLatency{});
  EXPECT_EQ(latency_of({77, 3, row.time, other}), DecisionLatency{});
  EXPECT_EQ(latency_of({77, 3, -5'000'000'000'000'000, row.clock}), DecisionLatency{});
  // of another run on its clock: from the newest row of this robot then
  const UntypedObservation newest = frontend.latest();
  const std::optional<DecisionLatency> known =
      latency_of({77, 3, newest.time() + 1, newest.schema().head.clock});
  ASSERT_TRUE(known.has_value());
  EXPECT_EQ(known->iterations, 1);

  manual.run(60);
  EXPECT_EQ(batch.decision_latency()->iterations, 4);
  EXPECT_EQ(batch.decision_latency()->time, -1) << "its row was overwritten";

  // it takes one block, and does not stay behind when that does not fit
  for (int i = 0; i < 13; ++i) add(frontend, 0, 1.0);
  EXPECT_THROW(frontend.pulse({.seen = newest}), LaneFull);
  EXPECT_EQ(frontend.added(), 13U);
  EXPECT_EQ(frontend.pulse().seen(), std::nullopt);
}

TEST_F(BatchTest, KeepsTheEndStatusesItSawAndForgetsTheRest) {
  std::string more;
  for (int i = 0; i < 100; ++i) more += "c = 0 to " + std::to_string(i) + "; run 1;";
  play({.segment = "pair", .lane_blocks = 16},
       "seen = 0 to 1; unseen = 0 to 2; run 2; seen completed;" + more +
           "seen completed; unseen forgotten; unseen waits");
}

// rule S3
TEST_F(BatchTest, NeverForgetsWhatStillRunsHoweverMuchIsSentMeanwhile) {
  std::string more;
  for (int i = 0; i < 499; ++i) more += "b = 1 to 1; run 1; a active; a open;";
  play({.segment = "pair", .lane_blocks = 16},
       "a = 0 to 1 over 500;" + more + "b = 1 to 0; run 1; a completed; a ended 500");
}

TEST_F(BatchTest, WaitsUntilTheLastOfItsCommandsHasEndedAndItsRowIsThere) {
  auto [manual, frontend] = StartedPair();
  add(frontend, 0, 1.0, {.pace = iterations(300)});
  add(frontend, 1, 1.0, {.pace = iterations(500)});
  const Batch batch = frontend.pulse();
  std::thread runner([&] { manual.run(1000); });
  batch.wait(kPatience);
  EXPECT_GE(frontend.published(), 500);
  EXPECT_EQ(batch.last_iteration(), 500);
  EXPECT_EQ(desired(frontend.wait_for(500, kAtOnce), 1), 1.0);
  runner.join();
}

TEST_F(BatchTest, AWaitThatTakesTooLongSaysWhatToDo) {
  auto [manual, frontend] = StartedPair();
  const Batch batch = send(frontend, 0, 1.0);
  EXPECT_THAT(message_of<TimeoutError>([&] { batch.wait(kAtOnce); }), HasSubstr("purge"));
}

}  // namespace
}  // namespace o80::test
