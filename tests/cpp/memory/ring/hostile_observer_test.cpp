// A user who may only read a segment takes every lock and sleeps on every word that he can reach:
// nothing changes for the others. Counts, not times.

#include "memory/hostile_observer.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <atomic>
#include <memory>
#include <thread>

#include "memory/os/futex.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segment/liveness.hpp"
#include "memory/segment/segment_draft.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

class HostileObserverTest : public SegmentTest {
 protected:
  HostileObserverTest() {
    chmod(directory_.path().c_str(), 0755);
    spec_.permission = 0644;
  }

  /// False if this test may not become another user.
  bool harass() {
    hostile_ = std::make_unique<HostileObserver>(directory_.path());
    return hostile_->wait_until_at_work();
  }

  /// How many sleepers the kernel wakes on this word while one thread of ours sleeps on it.
  static long woken_besides(const std::atomic<std::uint32_t>& word) {
    std::atomic<pid_t> sleeper{0};
    std::thread own([&] {
      sleeper = gettid();
      futex_wait(word, word.load(), 60'000'000'000);
    });
    while (sleeper == 0) std::this_thread::yield();
    const std::string task = "/proc/self/task/" + std::to_string(sleeper);
    while (!HostileObserver::is_asleep(task)) std::this_thread::yield();
    const long woken = syscall(SYS_futex, &word, FUTEX_WAKE, kEverybody, nullptr, nullptr, 0);
    own.join();
    return woken - 1;
  }

  SegmentSpec spec_ = small_spec();
  std::unique_ptr<HostileObserver> hostile_;
};

constexpr auto kNoStranger = "this user may not become another one";

TEST_F(HostileObserverTest, ThatTakesEveryLockKeepsNoLaneFromTheCommanders) {
  const OwnedSegment segment = running_segment(spec_);
  const AttachedSegment attached = attach();
  if (!harass()) GTEST_SKIP() << kNoStranger;
  EXPECT_GT(hostile_->threads(), 100U);

  const LaneSender first(attached);
  const LaneSender second(attached);
  EXPECT_EQ(first.lane(), 0U);
  EXPECT_EQ(second.lane(), 1U);
  EXPECT_THROW(LaneSender third(attached), NoLane);
}

TEST_F(HostileObserverTest, ThatQueuesForEveryLockDoesNotHideTheDeathOfACommander) {
  const OwnedSegment segment = running_segment(spec_);
  LaneLiveness liveness(segment);
  StandingProcess commander([](const StandingProcess::Stand& stand) {
    const AttachedSegment attached = attach();
    const LaneSender lane(attached);
    stand();
  });
  if (!harass()) GTEST_SKIP() << kNoStranger;
  liveness.refresh();
  EXPECT_EQ(liveness.lane(0), (LaneLife{LaneState::alive, 1}));

  commander.kill_now();

  liveness.refresh();
  EXPECT_EQ(liveness.lane(0), (LaneLife{LaneState::died, 1}));
}

TEST_F(HostileObserverTest, ThatQueuesForEveryLockDoesNotHideTheDeathOfABackend) {
  StandingProcess backend([&](const StandingProcess::Stand& stand) {
    const OwnedSegment segment = running_segment(spec_);
    stand();
  });
  const AttachedSegment commander = attach();
  const AttachedSegment observer = attach("arm", Access::read_only);
  if (!harass()) GTEST_SKIP() << kNoStranger;
  EXPECT_EQ(commander.life(), Life::running);
  EXPECT_EQ(observer.life(), Life::running);

  backend.kill_now();

  EXPECT_EQ(commander.life(), Life::killed);
  EXPECT_EQ(observer.life(), Life::killed);
  EXPECT_EQ(list_segments().at(0).life, Life::killed);
}

TEST_F(HostileObserverTest, DoesNotKeepTheNameOfADeadBackend) {
  for (const bool by_a_cleaner : {false, true}) {
    StandingProcess backend([&](const StandingProcess::Stand& stand) {
      const OwnedSegment segment = running_segment(spec_);
      stand();
    });
    if (!harass()) GTEST_SKIP() << kNoStranger;
    backend.kill_now();

    if (by_a_cleaner) {
      EXPECT_TRUE(clean("arm"));
    }
    const OwnedSegment next = running_segment(spec_);
    EXPECT_EQ(attach().epoch(), next.epoch());
  }
}

TEST_F(HostileObserverTest, DoesNotKeepTheFilesOfADeadStarter) {
  // killed when others may already read its draft, which has no name yet
  StandingProcess starter([&](const StandingProcess::Stand& stand) {
    SegmentDraft draft("arm");
    draft.permit(0644);
    stand();
  });
  if (!harass()) GTEST_SKIP() << kNoStranger;
  starter.kill_now();

  EXPECT_TRUE(clean_dead().empty());
  EXPECT_EQ(directory_.files(), 0U);
}

// rule O4
TEST_F(HostileObserverTest, SleepsOnNoWordThatOthersAreWokenBy) {
  const OwnedSegment segment = running_segment(spec_);
  if (!harass()) GTEST_SKIP() << kNoStranger;
  const SegmentView& view = segment.view();

  EXPECT_EQ(woken_besides(view.bell().rung), 0);
  EXPECT_EQ(woken_besides(view.wakes().row_wake), 0);
  EXPECT_EQ(woken_besides(view.wakes().lane_wake), 0);
}

}  // namespace
}  // namespace o80
