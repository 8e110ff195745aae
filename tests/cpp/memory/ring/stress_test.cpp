// Threads of one process in every role at once: work for the thread sanitizer, and for the
// processor's own order of memory. Bounded by rows and batches, not by time.

#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "memory/blocks.hpp"
#include "memory/ring/history.hpp"
#include "memory/segment/liveness.hpp"
#include "memory/segment/signal.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

constexpr Iteration kRows = 20'000;
constexpr std::size_t kNarrowWords = 8;

using NarrowRow = std::array<std::uint64_t, kNarrowWords>;

NarrowRow narrow_row(Iteration k) {
  NarrowRow row;
  for (std::size_t i = 0; i < kNarrowWords; ++i) row[i] = static_cast<std::uint64_t>(k) * 100 + i;
  return row;
}

std::byte* bytes_of(NarrowRow& row) { return reinterpret_cast<std::byte*>(row.data()); }

SegmentSpec spec_of_stress() {
  return {.name = "arm",
          .schema = {},
          .row_bytes = 8 * kNarrowWords,
          .rows = 4,
          .lanes = 4,
          .lane_blocks = 8};
}

class StressTest : public SegmentTest {
 protected:
  void publish(Iteration k) {
    NarrowRow row = narrow_row(k);
    writer_.publish(k, bytes_of(row));
    wake_sleepers(segment_.view(), {.rows = signal_.announce(k)});
  }

  OwnedSegment segment_ = running_segment(spec_of_stress());
  HistoryWriter writer_{segment_.view()};
  RowSignal signal_{segment_.view()};
};

TEST_F(StressTest, ReadersAndWaitersFollowAWriter) {
  std::vector<std::jthread> readers;
  // two wait for each row in turn, one jumps
  for (const Iteration stride : {1, 1, 7})
    readers.emplace_back([stride] {
      const AttachedSegment attached = attach();
      const HistoryReader reader(attached.view());
      RowWaiter waiter(attached);
      NarrowRow row;
      for (Iteration k = 0; k < kRows; k += stride) {
        ASSERT_EQ(waiter.wait_for_row(k, patient()), Waited::ready);
        if (reader.read(k, bytes_of(row))) {
          ASSERT_EQ(row, narrow_row(k));
        }
      }
    });
  for (Iteration k = 0; k < kRows; ++k) publish(k);
}

TEST_F(StressTest, WhatWasWrittenBeforeARowIsSeenAfterIt) {
  // plain memory, so that the sanitizer sees what orders it; it knows addresses, not the memory
  // behind them, so that both sides use one mapping
  constexpr Iteration kLast = 5'000;
  std::vector<Iteration> before(kLast + 1, -1);
  const std::jthread reader([&] {
    const HistoryReader history(segment_.view());
    for (Iteration k = 0; k <= kLast; ++k) {
      while (history.published() < k) std::this_thread::yield();
      ASSERT_EQ(before[static_cast<std::size_t>(k)], k);
    }
  });
  for (Iteration k = 0; k <= kLast; ++k) {
    before[static_cast<std::size_t>(k)] = k;
    publish(k);
  }
}

TEST_F(StressTest, SendersThatComeAndGoLoseNothing) {
  constexpr std::uint64_t kSenders = 3;
  constexpr std::uint64_t kLives = 8;
  constexpr std::uint64_t kBatches = 200;  // a life
  std::atomic<std::uint64_t> left{kSenders};

  std::vector<std::jthread> senders;
  for (std::uint64_t s = 0; s < kSenders; ++s)
    senders.emplace_back([&, s] {
      std::uint64_t number = s * kLives * kBatches;
      for (std::uint64_t life = 0; life < kLives; ++life) {
        const AttachedSegment attached = attach();
        LaneSender sender(attached);
        for (std::uint64_t i = 0; i < kBatches; ++i) {
          ++number;
          const std::size_t count = 1 + number % 5;
          ASSERT_EQ(sender.wait_until([&] { return sender.free_blocks() >= count; }, patient()),
                    Waited::ready);
          send(sender, number, count);
        }
        const auto all_taken = [&] { return sender.free_blocks() == sender.blocks(); };
        ASSERT_EQ(sender.wait_until(all_taken, patient()), Waited::ready);
      }
      --left;
      ring_bell(segment_.view());
    });

  LaneReceivers lanes(segment_.view(), kTicketAt);
  BellWaiter bell(segment_.view());
  LaneLiveness liveness(segment_);
  std::vector<std::uint64_t> last(kSenders, 0);
  std::uint64_t taken = 0;
  while (true) {
    const bool over = left == 0;
    bool news = lanes.poll();
    while (news) {
      const std::optional<std::uint32_t> lane = lanes.next();
      if (!lane) break;
      std::size_t count = 0;
      const std::uint64_t number = take_batch(lanes[*lane], &count);
      ASSERT_NE(number, 0U);
      std::uint64_t& newest = last[(number - 1) / (kLives * kBatches)];
      ASSERT_LT(newest, number);
      newest = number;
      ++taken;
      lanes[*lane].free(static_cast<std::uint32_t>(count));
      lanes[*lane].flag();
    }
    wake_sleepers(segment_.view(), {.lanes = lanes.announce()});
    if (over) break;
    bell.wait(lanes.bell_seen());
  }
  EXPECT_EQ(taken, kSenders * kLives * kBatches);
  for (std::uint32_t i = 0; i < lanes.size(); ++i) EXPECT_EQ(lanes[i].resets(), 0U);
}

TEST_F(StressTest, ANameIsTakenOverWhileOthersFollowIt) {
  constexpr int kSuccessors = 200;
  {
    const OwnedSegment first = std::move(segment_);
  }
  std::atomic<bool> over{false};
  std::vector<std::jthread> followers;
  for (int i = 0; i < 2; ++i)
    followers.emplace_back([&] {
      while (!over) {
        try {
          const AttachedSegment attached =
              AttachedSegment::attach("arm", Access::read_write, soon());
          RowWaiter waiter(attached);
          const HistoryReader reader(attached.view());
          NarrowRow row;
          for (Iteration k = 0;; ++k) {
            waiter.wait_for_row(k, patient());
            if (reader.read(k, bytes_of(row))) {
              ASSERT_EQ(row, narrow_row(k));
            }
          }
        } catch (const BackendGone&) {
        } catch (const TimeoutError&) {
        }
      }
    });
  // two want the name each time
  std::vector<std::jthread> starters;
  std::atomic<int> reigns{0};
  for (int i = 0; i < 2; ++i)
    starters.emplace_back([&] {
      while (reigns < kSuccessors) {
        try {
          OwnedSegment own = running_segment(spec_of_stress());
          HistoryWriter writer(own.view());
          RowSignal signal(own.view());
          for (Iteration k = 0; k < 20; ++k) {
            NarrowRow row = narrow_row(k);
            writer.publish(k, bytes_of(row));
            wake_sleepers(own.view(), {.rows = signal.announce(k)});
          }
          ++reigns;
        } catch (const SegmentTaken&) {
        }
      }
    });
  starters.clear();
  over = true;
}

}  // namespace
}  // namespace o80
