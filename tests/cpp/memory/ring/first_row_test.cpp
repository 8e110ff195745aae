#include "memory/ring/first_row.hpp"

#include <gmock/gmock.h>

#include <array>
#include <atomic>
#include <thread>
#include <vector>

#include "memory/ring/history.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

SegmentSpec named(const std::string& name) {
  SegmentSpec spec = small_spec();
  spec.name = name;
  return spec;
}

/// A segment whose rows this test publishes.
struct Source {
  explicit Source(const std::string& name)
      : segment(running_segment(named(name))), attached(attach(name)) {}
  void publish(Iteration k) {
    const std::vector<std::byte> row(64);
    writer.publish(k, row.data());
    wake_sleepers(segment.view(), {.rows = signal.announce(k)});
  }
  void wait_until_wanted(Iteration k) const {
    while (segment.view().bell().wanted.load() > k) std::this_thread::yield();
  }

  OwnedSegment segment;
  HistoryWriter writer{segment.view()};
  RowSignal signal{segment.view()};
  AttachedSegment attached;
};

class FirstRowTest : public SegmentTest {
 protected:
  std::array<RowOf, 2> rows(Iteration of_arm, Iteration of_ball) const {
    return {{{&arm_.attached, of_arm}, {&ball_.attached, of_ball}}};
  }

  Source arm_{"arm"};
  Source ball_{"ball"};
};

TEST_F(FirstRowTest, DoesNotWaitForARowThatIsThere) {
  ball_.publish(0);
  EXPECT_EQ(wait_for_first_row(rows(0, 0), Deadline(Timeout(0))), Waited::ready);
  EXPECT_EQ(wait_for_first_row(rows(0, 1), Deadline(Timeout(0))), Waited::timed_out);
}

TEST_F(FirstRowTest, IsWokenByEitherSegment) {
  Iteration k = 0;
  for (Source* source : {&arm_, &ball_}) {
    const std::array<RowOf, 2> wanted = rows(k, k);
    std::thread sleeper([&] { EXPECT_EQ(wait_for_first_row(wanted, patient()), Waited::ready); });
    arm_.wait_until_wanted(k);
    ball_.wait_until_wanted(k);
    source->publish(k);
    sleeper.join();
    // both begin anew
    (source == &arm_ ? ball_ : arm_).publish(k++);
  }
}

TEST_F(FirstRowTest, IsWokenBeforeItWouldLookAround) {
  int woken = 0;
  for (Iteration k = 0; k < 100; ++k) {
    std::atomic<int> looks{0};
    const std::array<RowOf, 2> wanted = rows(1000, k);
    std::thread sleeper([&] {
      const Waited waited = wait_for_first_row(wanted, patient(), [&] { return ++looks > 0; });
      EXPECT_EQ(waited, Waited::ready);
    });
    ball_.wait_until_wanted(k);
    ball_.publish(k);
    sleeper.join();
    woken += looks == 0 ? 1 : 0;
  }
  EXPECT_GT(woken, 0);
}

TEST_F(FirstRowTest, PassesTheWakeOnToThoseWhoWaitForOneSegment) {
  constexpr Iteration kLast = 300;
  std::vector<std::thread> sleepers;
  sleepers.reserve(8);
  for (int i = 0; i < 8; ++i) {
    sleepers.emplace_back([&, i] {
      for (Iteration k = 0; k <= kLast; ++k) {
        if (i % 2 == 0) {
          ASSERT_EQ(wait_for_first_row(rows(k, kLast + 1), patient()), Waited::ready);
        } else {
          ASSERT_EQ(RowWaiter(arm_.attached).wait_for_row(k, patient()), Waited::ready);
        }
      }
    });
  }
  for (Iteration k = 0; k <= kLast; ++k) {
    arm_.publish(k);
    std::this_thread::yield();
  }
  for (std::thread& sleeper : sleepers) sleeper.join();
}

TEST_F(FirstRowTest, RaisesTheEndOfAnyOfThemWhileNoRowIsThere) {
  std::thread sleeper(
      [&] { EXPECT_THROW(wait_for_first_row(rows(0, 0), patient()), BackendFailed); });
  arm_.wait_until_wanted(0);
  ball_.wait_until_wanted(0);
  ball_.segment.end(BackendState::failed, "no power");
  sleeper.join();

  arm_.publish(0);
  EXPECT_EQ(wait_for_first_row(rows(0, 0), patient()), Waited::ready);
  EXPECT_THROW(wait_for_first_row(rows(1, 0), Deadline(Timeout(0))), BackendFailed);
}

TEST_F(FirstRowTest, WaitsForReadOnlySegmentsAndForMoreThanOneSleepCanHave) {
  const AttachedSegment reader = attach("ball", Access::read_only);
  const AttachedSegment again = attach("ball");
  const std::vector<RowOf> two{{&arm_.attached, 0}, {&reader, 0}};
  std::vector<RowOf> many(200, RowOf{&arm_.attached, 1});
  many.push_back({&again, 1});
  Iteration k = 0;
  for (const std::vector<RowOf>& wanted : {two, many}) {
    std::thread sleeper([&] { EXPECT_EQ(wait_for_first_row(wanted, patient()), Waited::ready); });
    arm_.wait_until_wanted(k);
    ball_.publish(k);
    sleeper.join();
    arm_.publish(k++);
  }
}

TEST_F(FirstRowTest, EndsWhenTheCallerSaysSo) {
  EXPECT_THROW(wait_for_first_row(rows(0, 0), patient(), [] { return false; }), Cancelled);
}

}  // namespace
}  // namespace o80
