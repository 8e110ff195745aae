#include "memory/segment/halt_word.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <thread>
#include <vector>

#include "memory/child_process.hpp"
#include "memory/segment/signal.hpp"
#include "memory/segments.hpp"

namespace o80 {
namespace {

class HaltWordTest : public SegmentTest {
 protected:
  OwnedSegment segment_ = running_segment();
  HaltLatch latch_{segment_.view()};
};

TEST_F(HaltWordTest, NoHaltActsAtFirst) {
  EXPECT_FALSE(latch_.poll());
  EXPECT_FALSE(latch_.acts());
  EXPECT_EQ(shown_halt(attach().view()), std::nullopt);
}

TEST_F(HaltWordTest, AHaltIsLatchedAndShownWithWhoAndWhy) {
  const AttachedSegment frontend = attach();
  EXPECT_EQ(request_halt(frontend.view(), HaltCause::frontend, "pid 7 (python)", "it smokes"), 1U);
  ASSERT_TRUE(latch_.poll());
  EXPECT_TRUE(latch_.show(12));
  EXPECT_FALSE(latch_.poll());
  const auto halt = shown_halt(attach("arm", Access::read_only).view());
  ASSERT_TRUE(halt);
  EXPECT_EQ(halt->number, 1U);
  EXPECT_EQ(halt->cause, HaltCause::frontend);
  EXPECT_EQ(halt->iteration, 12);
  EXPECT_EQ(halt->who_text(), "pid 7 (python)");
  EXPECT_EQ(halt->reason(), "it smokes");
}

TEST_F(HaltWordTest, AReasonThatComesAfterTheHaltIsReadBeforeTheBackendShowsIt) {
  const AttachedSegment frontend = attach();
  frontend.view().bell().halts.fetch_add(1);  // the first step of request_halt
  ASSERT_TRUE(latch_.poll());
  EXPECT_FALSE(latch_.show(12));
  EXPECT_EQ(requested_halt(frontend.view())->reason(), "");
  put_halt(frontend.view(), 1, HaltCause::frontend, "pid 7 (python)", "it smokes");  // the second
  const auto halt = requested_halt(frontend.view());
  EXPECT_EQ(halt->cause, HaltCause::frontend);
  EXPECT_EQ(halt->reason(), "it smokes");
  EXPECT_EQ(halt->iteration, 12);
}

TEST_F(HaltWordTest, ANewerHaltThanTheOneThatWasSeenIsNotCleared) {
  const AttachedSegment frontend = attach();
  request_halt(frontend.view(), HaltCause::frontend, "a", "first");
  ASSERT_TRUE(latch_.poll());
  latch_.show(1);
  request_halt(frontend.view(), HaltCause::frontend, "b", "second");
  EXPECT_FALSE(latch_.clear());
  EXPECT_TRUE(latch_.acts());
  ASSERT_TRUE(latch_.poll());
  latch_.show(2);
  EXPECT_EQ(shown_halt(frontend.view())->reason(), "second");
  EXPECT_TRUE(latch_.clear());
  EXPECT_FALSE(latch_.acts());
  EXPECT_EQ(shown_halt(frontend.view()), std::nullopt);
}

TEST_F(HaltWordTest, TextsThatAreTooLongAreCut) {
  const std::string long_text(1000, 'x');
  request_halt(segment_.view(), HaltCause::driver, long_text, long_text);
  ASSERT_TRUE(latch_.poll());
  EXPECT_TRUE(latch_.show(0));
  EXPECT_EQ(latch_.halt().who_text(), std::string(63, 'x'));
  EXPECT_EQ(latch_.halt().reason(), std::string(247, 'x'));
}

TEST_F(HaltWordTest, AHaltNeedsNoLane) {
  const AttachedSegment first = attach();
  const AttachedSegment second = attach();
  const LaneSender one(first);
  const LaneSender two(second);  // that is all of them
  request_halt(attach().view(), HaltCause::frontend, "", "");
  EXPECT_TRUE(latch_.poll());
}

TEST_F(HaltWordTest, ACounterThatIsTurnedBackIsAHaltToo) {
  segment_.view().bell().halts = 5;
  ASSERT_TRUE(latch_.poll());
  ASSERT_TRUE(latch_.clear());
  segment_.view().bell().halts = 0;
  ASSERT_TRUE(latch_.poll());
  EXPECT_TRUE(latch_.acts());
  EXPECT_TRUE(latch_.clear());
}

TEST_F(HaltWordTest, AHaltWakesABackendThatStandsStill) {
  BellWaiter bell(segment_.view());
  std::thread backend([&] {
    while (!latch_.poll()) {
      const std::uint32_t seen = bell.value();
      if (!latch_.poll()) bell.wait(seen);
      if (latch_.acts()) break;
    }
  });
  request_halt(attach().view(), HaltCause::frontend, "", "");
  backend.join();
  EXPECT_TRUE(latch_.acts());
}

// work for the thread sanitizer: the reasons of many askers, latched and read at the same time
TEST_F(HaltWordTest, EachHaltThatIsShownHasItsOwnReason) {
  constexpr int kEach = 300;
  std::atomic<int> asking{3};
  std::atomic<bool> over{false};
  std::vector<std::jthread> threads;
  for (int i = 0; i < 3; ++i)
    threads.emplace_back([&] {
      const AttachedSegment frontend = attach();
      for (int n = 0; n < kEach; ++n)
        request_halt(frontend.view(), HaltCause::frontend, "me", "why");
      --asking;
    });
  threads.emplace_back([&] {
    const AttachedSegment reader = attach("arm", Access::read_only);
    while (!over) {
      const auto halt = shown_halt(reader.view());
      if (!halt || halt->cause == HaltCause::none) continue;
      EXPECT_EQ(halt->who_text(), "me");
      EXPECT_EQ(halt->reason(), "why");
      EXPECT_GT(halt->number, 0U);
    }
  });
  std::uint64_t last = 0;
  Iteration iteration = 0;
  while (asking > 0 || last < 3 * kEach) {
    if (!latch_.poll()) continue;
    EXPECT_GT(latch_.halt().number, last);
    last = latch_.halt().number;
    latch_.show(iteration++);
    latch_.clear();
  }
  over = true;
  EXPECT_EQ(last, 3U * kEach);
}

TEST_F(HaltWordTest, AForkedChildMayHalt) {
  const AttachedSegment frontend = attach();
  EXPECT_EQ(in_child([&] {
              request_halt(frontend.view(), HaltCause::frontend, "the child", "");
              return 0;
            }),
            0);
  ASSERT_TRUE(latch_.poll());
  EXPECT_TRUE(latch_.show(0));
  EXPECT_EQ(latch_.halt().who_text(), "the child");
}

TEST_F(HaltWordTest, TheHaltOfAKilledProcessStands) {
  StandingProcess child([&](const StandingProcess::Stand& stand) {
    request_halt(attach().view(), HaltCause::frontend, "gone", "last word");
    stand();
  });
  child.kill_now();
  ASSERT_TRUE(latch_.poll());
  EXPECT_TRUE(latch_.show(0));
  EXPECT_EQ(latch_.halt().reason(), "last word");
}

// killed between the count and the reason: it halts, and says nothing of itself
TEST_F(HaltWordTest, AHaltWithoutItsReasonActs) {
  request_halt(segment_.view(), HaltCause::frontend, "before", "");
  segment_.view().bell().halts.fetch_add(1);
  ASSERT_TRUE(latch_.poll());
  EXPECT_FALSE(latch_.show(3));
  EXPECT_EQ(latch_.halt().number, 2U);
  EXPECT_EQ(latch_.halt().cause, HaltCause::none);
  const auto halt = shown_halt(segment_.view());
  ASSERT_TRUE(halt);
  EXPECT_EQ(halt->iteration, 3);
  EXPECT_EQ(halt->who_text(), "");
}

}  // namespace
}  // namespace o80
