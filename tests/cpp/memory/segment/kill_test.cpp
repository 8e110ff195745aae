// What becomes of a segment when one of its processes is killed.

#include <fcntl.h>
#include <gmock/gmock.h>

#include <thread>

#include "memory/blocks.hpp"
#include "memory/child_process.hpp"
#include "memory/ring/history.hpp"
#include "memory/segment/segment_draft.hpp"
#include "memory/segment/segment_name.hpp"
#include "memory/segment/signal.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using KillTest = SegmentTest;

void publish(const OwnedSegment& segment, Iteration rows) {
  HistoryWriter writer(segment.view());
  RowSignal signal(segment.view());
  for (Iteration k = 0; k < rows; ++k) {
    const std::vector<Iteration> row(8, k);
    writer.publish(k, reinterpret_cast<const std::byte*>(row.data()));
    wake_sleepers(segment.view(), {.rows = signal.announce(k)});
  }
}

void be_a_backend(const StandingProcess::Stand& stand) {
  const OwnedSegment segment = running_segment();
  publish(segment, 10);
  stand();
}

TEST_F(KillTest, EndsTheWaitsOfItsFrontendsAndLeavesTheHistory) {
  StandingProcess backend(be_a_backend);
  const AttachedSegment segment = attach();
  const AttachedSegment reader = attach("arm", Access::read_only);
  LaneSender sender(segment);
  std::int64_t killed_at = 0;
  std::atomic<int> waiting{0};
  const KeepWaiting count = [&] {
    ++waiting;
    return true;
  };
  const auto wait_for_a_row = [&](const AttachedSegment& at) {
    RowWaiter waiter(at);
    EXPECT_THAT(
        message_of<BackendKilled>([&] { waiter.wait_for_row(1000, patient(), count); }),
        AllOf(HasSubstr("'arm'"), HasSubstr("was killed"), HasSubstr("history can still be read")));
  };
  std::thread row([&] { wait_for_a_row(segment); });
  std::thread poll([&] { wait_for_a_row(reader); });
  std::thread lane([&] {
    EXPECT_THROW(sender.wait_until([] { return false; }, patient(), count), BackendKilled);
  });
  while (waiting < 6) std::this_thread::yield();
  backend.kill_now();
  killed_at = monotonic_now();
  row.join();
  poll.join();
  lane.join();
  RecordProperty("noticed_after_us", std::to_string((monotonic_now() - killed_at) / 1000));

  HistoryReader history(segment.view());
  std::vector<Iteration> rows(80);
  const auto range = history.read_range(0, 10, reinterpret_cast<std::byte*>(rows.data()));
  EXPECT_EQ(range.count, 10U);
  EXPECT_EQ(rows[79], 9);

  // also for those who come later, by option
  EXPECT_EQ(attach_dead().life(), Life::killed);
  EXPECT_THAT(
      message_of<TimeoutError>([] { AttachedSegment::attach("arm", Access::read_only, soon()); }),
      HasSubstr("was killed"));
}

// rule O10
TEST_F(KillTest, LetsANewBackendTakeOverAtOnceWhileOldReadersReadOn) {
  StandingProcess backend(be_a_backend);
  const AttachedSegment old = attach();
  backend.kill_now();

  const OwnedSegment next = running_segment();

  EXPECT_EQ(directory_.files(), 2U);
  EXPECT_THROW(old.throw_if_gone(), BackendSuperseded);
  EXPECT_EQ(HistoryReader(old.view()).published(), 9);
  const AttachedSegment fresh = attach();
  EXPECT_EQ(fresh.epoch(), next.epoch());
  EXPECT_EQ(HistoryReader(fresh.view()).published(), -1);
}

TEST_F(KillTest, IsNotForgottenWhileASuccessorHoldsTheLockOfTheDead) {
  StandingProcess backend(be_a_backend);
  const AttachedSegment seen = attach();
  AttachedSegment other = attach();
  LaneSender sender(seen);
  EXPECT_NO_THROW(seen.throw_if_known_gone());
  backend.kill_now();
  EXPECT_THROW(RowWaiter(seen).wait_for_row(1000, patient()), BackendKilled);
  EXPECT_EQ(other.life(), Life::killed);

  // as a successor does before it marks the old header
  LockFile successor = LockFile::open(commands_path("arm", seen.epoch()), O_RDWR);
  ASSERT_TRUE(successor.try_lock(kBackendByte));
  const Deadline at_once(std::chrono::nanoseconds(0));
  EXPECT_THROW(RowWaiter(seen).wait_for_row(1000, at_once), BackendKilled);
  EXPECT_THROW(sender.wait_until([] { return false; }, at_once), BackendKilled);
  EXPECT_THROW(seen.throw_if_gone(), BackendKilled);
  EXPECT_THROW(seen.throw_if_known_gone(), BackendKilled);
  const AttachedSegment moved = std::move(other);
  EXPECT_EQ(moved.life(), Life::killed);

  successor.close();
  const OwnedSegment next = running_segment();
  EXPECT_EQ(moved.life(), Life::superseded);
  EXPECT_EQ(attach().life(), Life::running);
}

TEST_F(KillTest, FreesTheLaneOfADeadFrontendAndKeepsWhatItCommitted) {
  const OwnedSegment segment = running_segment();
  LaneReceivers lanes(segment.view(), kTicketAt);
  StandingProcess frontend([](const StandingProcess::Stand& stand) {
    const AttachedSegment attached = attach();
    LaneSender sender(attached);
    sender.draw_ids(11);
    send(sender, 1, 3);
    stand();
  });
  frontend.kill_now();

  const AttachedSegment attached = attach();
  LaneSender next(attached);
  EXPECT_EQ(next.lane(), 0U);
  EXPECT_EQ(next.incarnation(), 2U);
  EXPECT_EQ(next.next_id(), 11U);
  EXPECT_EQ(lanes[0].closed(), 0U);
  send(next, 2, 5);

  std::vector<std::uint64_t> taken;
  ASSERT_TRUE(lanes.poll());
  while (const auto lane = lanes.next()) taken.push_back(take_batch(lanes[*lane]));
  EXPECT_THAT(taken, ElementsAre(1, 2));
}

TEST_F(KillTest, WakesOthersWhenAWaiterIsKilledAsleep) {
  OwnedSegment segment = running_segment();
  ChildProcess asleep([](const ChildProcess::Ready& ready) {
    const AttachedSegment attached = attach();
    RowWaiter waiter(attached);
    int looks = 0;
    waiter.wait_for_row(0, patient(), [&] {
      if (++looks == 1) ready();
      return true;
    });
  });
  ASSERT_TRUE(asleep.wait_until_ready());
  const AttachedSegment attached = attach();
  std::thread waiter(
      [&] { EXPECT_EQ(RowWaiter(attached).wait_for_row(0, patient()), Waited::ready); });
  asleep.kill_now();
  publish(segment, 1);
  waiter.join();
}

}  // namespace
}  // namespace o80
