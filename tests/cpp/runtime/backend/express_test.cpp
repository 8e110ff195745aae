// Purges and control orders wait for nobody, commands older than a purge do not outlive it, and
// what would keep an iteration too long is refused before it is sent.

#include <unistd.h>

#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "memory/segment/owned_segment.hpp"
#include "memory/segment/queue_word.hpp"
#include "runtime/backend/schedule.hpp"
#include "runtime/frontend/loop_state.hpp"
#include "runtime/hostile_frontend.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using ExpressTraces = ManualBackendTest;

class ExpressTest : public ManualBackendTest {
 protected:
  /// So many frontends, each with as much in its lane as fits.
  std::vector<UntypedFrontend> flood(std::size_t count) {
    std::vector<UntypedFrontend> frontends;
    for (std::size_t i = 0; i < count; ++i) {
      frontends.emplace_back("pair");
      for (int command = 0; command < 16'300; ++command) {
        add(frontends.back(), 0, 1.0, {.pace = iterations(1'000'000)});
      }
      floods.push_back(frontends.back().pulse());
    }
    return frontends;
  }

  StartedBackend manual;
  UntypedFrontend one{"pair"};
  std::vector<Batch> floods;
};

// rule B8
TEST_F(ExpressTest, APurgeIsTakenInTheIterationAfterItsCommitWhateverLiesInOtherLanes) {
  const Batch moving = send(one, 0, 9.0, {.pace = iterations(1000)});
  manual.run(3);
  const auto others = flood(7);
  manual.run(2);
  // a little of its own stands before it, which waits for the others' turn
  const Batch queued = send(one, 0, 5.0, {.pace = iterations(10)});
  const Batch mixed = send(one, 1, 5.0, {.pace = iterations(10)});
  one.add_purge(0);
  const Batch purge = one.pulse({.seen = one.latest()});
  const Iteration now = manual.last() + 1;
  manual.run(1);
  EXPECT_EQ(purge.first_iteration(), now);
  EXPECT_EQ(purge.handle(0).status, Status::completed);
  EXPECT_EQ(moving.handle(0).status, Status::purged);
  EXPECT_EQ(moving.handle(0).iteration, now);
  EXPECT_EQ(queued.first_iteration(), -1) << "commands keep their turn";

  // when their turn comes
  for (int i = 0; i < 1000 && !(mixed.ended() && queued.ended()); ++i) manual.run(1);
  EXPECT_EQ(queued.handle(0).status, Status::purged);
  EXPECT_EQ(mixed.handle(0).status, Status::completed) << "of another actuator";
  for (const Batch& flood : floods) {
    EXPECT_EQ(flood.handle(0).status, Status::purged) << "older than the purge, taken later";
  }
  EXPECT_EQ(desired(one.latest()), desired(one.wait_for(now, kAtOnce))) << "nothing has moved it";
}

TEST_F(ExpressTest, NamesTheFrontendWhoseBatchesOthersWaitFor) {
  send(one, 1, 1.0);
  manual.run(1);
  EXPECT_EQ(queue_holder(one.link()->segment.view()), std::nullopt);
  const auto others = flood(1);
  const Iteration begun = manual.last() + 1;
  manual.run(1);
  const Batch waiting = send(one, 1, 2.0);
  manual.run(kLongQueue);

  const std::optional<QueueHolder> holder = queue_holder(one.link()->segment.view());
  ASSERT_TRUE(holder.has_value());
  EXPECT_EQ(holder->lane, others[0].link()->lane()->lane());
  EXPECT_EQ(holder->since, begun);
  std::string program;
  std::ifstream("/proc/self/comm") >> program;
  const std::string told = "most of the queue is from the frontend of pid " +
                           std::to_string(getpid()) + " (" + program +
                           "); batches have been waiting since iteration " + std::to_string(begun);
  EXPECT_THAT([&] { waiting.wait(std::chrono::nanoseconds(0)); },
              ::testing::ThrowsMessage<TimeoutError>(HasSubstr("not taken yet: " + told)));
  EXPECT_EQ(loop_state(one).queue, told);
  const UntypedFrontend reader("pair", {.access = Access::read_only});
  EXPECT_EQ(loop_state(reader).trouble(), told);

  for (int i = 0; i < 1000 && !waiting.ended(); ++i) manual.run(1);
  manual.run(1);
  EXPECT_EQ(loop_state(one).queue, "");
}

TEST_F(ExpressTest, TheHolderOfTheQueueIsTheLaneThatDoesMostOfTheWork) {
  const UntypedFrontend reader("pair", {.access = Access::read_only});
  const SegmentView& view = reader.link()->segment.view();
  QueueWord word(manual.backend.segment().view());
  word.waits(1);
  EXPECT_EQ(queue_holder(view), std::nullopt) << "nobody has done any work";
  for (Iteration i = 2; i < 1'000'000; ++i) {
    word.spent(3, 1024);
    word.waits(i);
  }
  ASSERT_EQ(queue_holder(view), (QueueHolder{.lane = 3, .since = 2}));
  int taken_over = 0;
  while (queue_holder(view)->lane == 3) {
    word.spent(5, 1024);
    word.waits(1'000'000);
    ASSERT_LT(++taken_over, 20) << "after a thousand seconds of the other";
  }
  EXPECT_EQ(queue_holder(view), (QueueHolder{.lane = 5, .since = 2})) << "batches have waited on";
}

TEST_F(ExpressTest, ControlIsTakenAtOnceToo) {
  send(one, 1, 1.0);
  manual.run(1);
  const auto others = flood(7);
  manual.run(1);
  one.add_take_control();
  const Batch control = one.pulse();
  const Iteration now = manual.last() + 1;
  manual.run(1);
  EXPECT_EQ(control.first_iteration(), now);
  const Batch mine = send(one, 1, 2.0);
  for (int i = 0; i < 400 && !mine.ended(); ++i) manual.run(1);
  EXPECT_EQ(mine.handle(0).status, Status::completed);
  EXPECT_EQ(floods.back().handle(0).reason, Reason::exclusive);
}

TEST_F(ExpressTest, ControlIsNotLetGoOfBeforeWhatWasSentUnderIt) {
  one.add_take_control();
  one.pulse();
  manual.run(1);
  const auto others = flood(7);
  manual.run(1);
  const Batch mine = send(one, 1, 2.0);
  one.add_release_control();
  const Batch release = one.pulse();
  for (int i = 0; i < 1000 && !release.ended(); ++i) manual.run(1);
  EXPECT_EQ(mine.handle(0).status, Status::completed);
  EXPECT_GE(release.first_iteration(), mine.first_iteration());
}

TEST_F(ExpressTest, AResumeWaitsForWhatWasSentBeforeIt) {
  const std::uint64_t number = one.halt("stop");
  manual.run(1);
  const auto others = flood(7);
  manual.run(1);
  const Batch resumed = send_resume(one, number);
  for (int i = 0; i < 1000 && !resumed.ended(); ++i) manual.run(1);
  EXPECT_EQ(resumed.handle(0).status, Status::completed) << resumed.handle(0).text;
  for (const Batch& flood : floods) {
    EXPECT_EQ(flood.handle(0).reason, Reason::halted) << "sent while the robot was halted";
  }
}

TEST_F(ExpressTraces, APurgeEndsWhatWaitsForALaterIterationIfItWasSentBefore) {
  play(R"(0 to 1; 1 to 1; a = pulse at 5; B: b = purge 0; c = 0 to 2 at 6; run 8
    a purged @5; a.1 completed; c completed  # when it would have acted)");
}

// rule B4
TEST_F(ExpressTraces, WhoMayCommandIsDecidedWhenABatchActs) {
  play(R"(take; a = pulse; run 1; B: later = 0 to 1 at 6; B: sooner = 1 to 1 at 3; run 3
    sooner rejected exclusive @3; a = release; run 4; later completed)");
}

// ------------------------------------------------------------------------------ refused in pulse

TEST_F(ExpressTest, MoreRequestsOrOrdersThanABatchMayHaveAreRefused) {
  for (std::uint32_t i = 0; i < kMaxRequests + 1; ++i) add_request<Snapshot>(one);
  EXPECT_THAT(message_of<InvalidArgument>([&] { one.pulse(); }),
              AllOf(HasSubstr("at most 8 requests, this one has 9"), HasSubstr("several pulses")));
  EXPECT_EQ(one.added(), kMaxRequests + 1) << "nothing was sent";
  one.forget_added();
  for (std::uint32_t i = 0; i < kMaxOrders + 1; ++i) one.add_take_control();
  EXPECT_THAT(message_of<InvalidArgument>([&] { one.pulse(); }), HasSubstr("control"));
}

TEST_F(ExpressTest, MoreBatchesThanMayWaitForLaterIterationsAreRefused) {
  const auto pulse_at = [&](Iteration at) {
    add(one, 0, 1.0);
    return one.pulse({.at = at});
  };
  std::vector<Batch> batches;
  for (std::uint32_t i = 0; i < kMaxScheduledAt; ++i) batches.push_back(pulse_at(900));
  EXPECT_THAT(message_of<LaneFull>([&] { pulse_at(900); }),
              AllOf(HasSubstr("16 batches"), HasSubstr("iteration 900"), HasSubstr("one batch")));
  one.forget_added();
  for (std::uint32_t i = kMaxScheduledAt; i < kMaxScheduled; ++i) {
    batches.push_back(pulse_at(901 + i / 2));
  }
  EXPECT_THAT(message_of<LaneFull>([&] { pulse_at(2000); }), HasSubstr("256 batches"));
  // what was sent is still added, and goes when there is room
  manual.run(901);
  EXPECT_EQ(one.pulse({.at = 2000}).size(), 1U);
  manual.run(1200);
  for (const Batch& batch : batches) EXPECT_EQ(batch.handle(0).status, Status::completed);
}

TEST_F(ExpressTest, ABackendRejectsWhatASenderPutsIntoItsScheduleBeyondThat) {
  HostileFrontend hostile;
  std::vector<CommandId> ids;
  for (std::uint32_t i = 0; i < kMaxScheduledAt + 1; ++i) {
    BatchBuilder batch;
    batch.purge(0);
    ids.push_back(hostile.draw_id());
    hostile.send(batch, {.id = ids.back(), .at = 50});
  }
  manual.run(60);
  EXPECT_EQ(hostile.status(ids.front()), Status::active);
  EXPECT_EQ(hostile.status(ids.back()), Status::rejected);
  EXPECT_EQ(static_cast<Reason>(hostile.sender().status(ids.back()).word.reason), Reason::full);
}

TEST_F(ExpressTraces, ABatchThatCannotBeTakenAtItsIterationIsLateUnlessItMayActInALaterOne) {
  // eight requests an iteration: two of these batches
  const std::string four = "snapshot; snapshot; snapshot; snapshot;";
  play(four + "a = pulse at 20;" + four + "b = pulse at 20;" + four + R"(c = pulse at 20; run 30
    b taken 20; b completed; c rejected late)");
  std::string late, taken;
  for (int i = 0; i < 6; ++i) {
    late += four + "b" + std::to_string(i) + " = pulse at 20 late;";
    taken += "; b" + std::to_string(i) + " taken " + std::to_string(20 + i / 2);
  }
  play(late + "run 30" + taken + "; b5 completed");
}

// ------------------------------------------------------------------------------ ids

TEST_F(ExpressTest, APurgeAlwaysHasIdsHoweverNarrowTheGapsBetweenThoseInUse) {
  StartedBackend bursting({.segment = "bursting", .bursting = true, .lane_blocks = 1024});
  one = UntypedFrontend("bursting");
  // long commands and bursts in turn leave gaps of ids two wide
  std::vector<Batch> running;
  try {
    while (true) {
      running.push_back(send(one, 0, 1.0, {.pace = iterations(1'000'000)}));
      one.start_burst(1);
      bursting.drive();
    }
  } catch (const LaneFull&) {
    one.forget_added();
  }
  ASSERT_GT(running.size(), 300U);
  for (int i = 0; i < 3000; ++i) {
    add_request<Snapshot>(one);
    const Batch request = one.pulse();
    bursting.drive();
    ASSERT_EQ(request.handle(0).status, Status::completed) << i;
  }
  one.add_purge();
  const Batch purge = one.pulse();
  bursting.drive();
  EXPECT_EQ(purge.handle(0).status, Status::completed);
  EXPECT_EQ(running.front().handle(0).status, Status::purged);
  EXPECT_EQ(running.back().handle(0).status, Status::purged);
}

}  // namespace
}  // namespace o80::test
