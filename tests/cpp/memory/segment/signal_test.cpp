#include "memory/segment/signal.hpp"

#include <gmock/gmock.h>
#include <sched.h>

#include <atomic>
#include <thread>

#include "memory/ring/history.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

constexpr Iteration kNobody = std::numeric_limits<Iteration>::max();

class SignalTest : public SegmentTest {
 protected:
  void publish(Iteration from, Iteration to) {
    const std::vector<std::byte> row(64);
    for (Iteration k = from; k <= to; ++k) {
      writer_.publish(k, row.data());
      wake_sleepers(segment_.view(), {.rows = signal_.announce(k)});
    }
  }
  Iteration wanted() const { return segment_.view().bell().wanted.load(); }
  void wait_until_wanted(Iteration k) const {
    while (wanted() > k) std::this_thread::yield();
  }

  OwnedSegment segment_ = running_segment();
  HistoryWriter writer_{segment_.view()};
  RowSignal signal_{segment_.view()};
  AttachedSegment attached_ = attach();
};

TEST_F(SignalTest, DoesNotWaitForARowThatIsThere) {
  publish(0, 3);
  RowWaiter waiter(attached_);
  EXPECT_EQ(waiter.wait_for_row(3, Deadline(Timeout(0))), Waited::ready);
  EXPECT_EQ(waiter.wait_for_row(4, Deadline(Timeout(0))), Waited::timed_out);
}

TEST_F(SignalTest, WakesASleeperByItsRowAndByNoEarlierOne) {
  std::thread sleeper([&] {
    RowWaiter waiter(attached_);
    EXPECT_EQ(waiter.wait_for_row(5, patient()), Waited::ready);
  });
  wait_until_wanted(5);
  publish(0, 4);
  EXPECT_EQ(wanted(), 5);
  publish(5, 5);
  sleeper.join();
  EXPECT_EQ(wanted(), kNobody);
}

TEST_F(SignalTest, LetsReadersWithoutWritePermissionPoll) {
  const AttachedSegment reader = attach("arm", Access::read_only);
  std::atomic<bool> requested{false};
  std::thread sleeper([&] {
    RowWaiter waiter(reader);
    EXPECT_EQ(waiter.wait_for_row(0, patient(),
                                  [&] {
                                    requested = true;
                                    return true;
                                  }),
              Waited::ready);
  });
  while (!requested) std::this_thread::yield();
  EXPECT_EQ(wanted(), kNobody);
  publish(0, 0);
  sleeper.join();
}

TEST_F(SignalTest, RaisesTheFaultForThoseWhoWait) {
  std::thread sleeper([&] {
    RowWaiter waiter(attached_);
    EXPECT_THROW(waiter.wait_for_row(5, patient()), BackendFailed);
  });
  wait_until_wanted(5);
  segment_.end(BackendState::failed, "no power");
  sleeper.join();
}

TEST_F(SignalTest, GivesRowsThatCameBeforeTheEndAndRaisesItHoweverShortTheWait) {
  publish(0, 0);
  RowWaiter waiter(attached_);
  EXPECT_EQ(waiter.wait_for_row(1, Deadline(Timeout(0))), Waited::timed_out);

  segment_.end(BackendState::stopped);

  EXPECT_EQ(waiter.wait_for_row(0, Deadline(Timeout(0))), Waited::ready);
  EXPECT_THROW(waiter.wait_for_row(1, Deadline(Timeout(0))), BackendStopped);
}

TEST_F(SignalTest, EndsAWaitWhenTheCallerSaysSo) {
  RowWaiter waiter(attached_);
  EXPECT_THROW(waiter.wait_for_row(0, patient(), [] { return false; }), Cancelled);
}

TEST_F(SignalTest, HealsAWakeUpThatWasLost) {
  std::thread sleeper([&] {
    RowWaiter waiter(attached_);
    EXPECT_EQ(waiter.wait_for_row(0, patient()), Waited::ready);
  });
  wait_until_wanted(0);
  const std::vector<std::byte> row(64);
  writer_.publish(0, row.data());  // and nobody is woken
  sleeper.join();
}

/// A waiter on the loop's processor, for which row 1 is expected in an hour.
class PunctualSignalTest : public SignalTest {
 protected:
  static constexpr std::int64_t kHour = 3600 * std::int64_t{1'000'000'000};

  void SetUp() override {
    ASSERT_EQ(sched_getaffinity(0, sizeof allowed_, &allowed_), 0);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(sched_getcpu(), &one);
    ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
    publish(0, 0);
    signal_.expect_next(monotonic_now() + kHour, kHour);
  }
  void TearDown() override { sched_setaffinity(0, sizeof allowed_, &allowed_); }
  /// The row for which one of these short waits has registered: one that spins for all its time
  /// does not.
  Iteration registered(Iteration k, int waits = 10'000) const {
    RowWaiter waiter(attached_);
    for (; waits > 0 && wanted() == kNobody; --waits) {
      EXPECT_EQ(waiter.wait_for_row(k, Deadline(std::chrono::milliseconds(1))), Waited::timed_out);
    }
    return wanted();
  }
  Counters& counters() const { return segment_.view().counters(); }

  cpu_set_t allowed_{};
};

TEST_F(PunctualSignalTest, SleepsByTheClockOnTheProcessorOfTheLoop) {
  EXPECT_EQ(registered(1, 10), kNobody);
}

TEST_F(PunctualSignalTest, RegistersOnAnotherProcessor) {
  counters().processor = -1;
  EXPECT_EQ(registered(1), 1);
}

TEST_F(PunctualSignalTest, RegistersForALaterRow) { EXPECT_EQ(registered(2), 2); }

TEST_F(PunctualSignalTest, RegistersOnceTheRowIsLate) {
  signal_.expect_next(monotonic_now() - kHour, kHour);
  EXPECT_EQ(registered(1), 1);
}

TEST_F(PunctualSignalTest, GetsARowThatCameDuringTheSleep) {
  signal_.expect_next(monotonic_now() + 20'000'000, 20'000'000);
  RowWaiter waiter(attached_);
  std::thread writer([&] { publish(1, 1); });
  EXPECT_EQ(waiter.wait_for_row(1, patient()), Waited::ready);
  writer.join();
}

TEST_F(SignalTest, ExpectsTheNextRowAsLateAsThePunctualOneOfTheLastTwo) {
  constexpr std::int64_t kPeriod = 1'000'000;
  constexpr std::int64_t kLate = 1'000'000'000;
  const auto expected_after_due = [&](std::int64_t delay) {
    const std::int64_t due = monotonic_now() - delay + kPeriod;
    signal_.expect_next(due, kPeriod);
    return segment_.view().counters().next_at - due;
  };
  const std::int64_t punctual = expected_after_due(kLate);
  EXPECT_LT(punctual, kPeriod) << "no row was late before";
  EXPECT_GE(expected_after_due(2 * kLate), kLate) << "both were late";
  EXPECT_LT(expected_after_due(-kLate), 0);
  EXPECT_LT(expected_after_due(kLate), 0) << "the one before was not";
}

TEST_F(SignalTest, TellsTheBackendThatTheBellRang) {
  BellWaiter bell(segment_.view());
  const std::uint32_t seen = bell.value();
  EXPECT_FALSE(bell.wait(seen, 1000));
  ring_bell(attached_.view());
  EXPECT_TRUE(bell.wait(seen));
}

TEST_F(SignalTest, WakesABackendThatSleepsAtTheBell) {
  std::thread backend([&] {
    BellWaiter bell(segment_.view());
    const std::uint32_t seen = bell.value();
    while (!bell.wait(seen)) {
    }
  });
  while (segment_.view().wakes().sleeping.load() == 0) std::this_thread::yield();
  ring_bell(segment_.view());
  backend.join();
  EXPECT_EQ(segment_.view().wakes().sleeping.load(), 0U);
}

}  // namespace
}  // namespace o80
