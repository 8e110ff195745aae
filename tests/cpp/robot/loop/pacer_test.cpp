#include "robot/loop/pacer.hpp"

#include <gtest/gtest.h>

#include "o80/base/time.hpp"

namespace o80 {
namespace {

TEST(Pacer, SetsOnePeriodBehindTheOther) {
  Pacer pacer(100);
  pacer.begin(1000);
  EXPECT_EQ(pacer.due(), 1100);
  EXPECT_TRUE(pacer.in_time(1060));
  EXPECT_EQ(pacer.next(1107).lateness, 7);
  EXPECT_EQ(pacer.due(), 1200) << "a late awakening does not shift the periods";
  EXPECT_TRUE(pacer.in_time(1200));
  const Timing timing = pacer.next(1200);
  EXPECT_EQ(timing.overruns, 0U);
  EXPECT_EQ(timing.skipped, 0U);
  EXPECT_EQ(timing.next_due, 1300);
}

TEST(Pacer, CountsAnOverrunAndGoesOnInTheSameBeat) {
  Pacer pacer(100);
  pacer.begin(0);
  EXPECT_FALSE(pacer.in_time(130));
  const Timing timing = pacer.next(131);
  EXPECT_EQ(timing.overruns, 1U);
  EXPECT_EQ(timing.skipped, 0U) << "the next period has begun, it is not over";
  EXPECT_EQ(timing.lateness, 31);
  EXPECT_EQ(pacer.due(), 200);
}

TEST(Pacer, LeavesOutThePeriodsItMissedSoThatNoBurstOfLateIterationsFollows) {
  Pacer pacer(100);
  pacer.begin(0);
  EXPECT_FALSE(pacer.in_time(1'000'050));
  const Timing timing = pacer.next(1'000'050);
  EXPECT_EQ(timing.overruns, 1U);
  EXPECT_EQ(timing.skipped, 9'999U + 1U - 1U);
  EXPECT_EQ(pacer.due(), 1'000'100);
  // what follows is on time again, one iteration a period
  for (std::int64_t now = 1'000'060; now < 1'002'000; now += 100) {
    ASSERT_TRUE(pacer.in_time(now));
    ASSERT_EQ(pacer.due() - now, 40);
    ASSERT_EQ(pacer.next(pacer.due()).overruns, 1U);
  }
}

TEST(Pacer, CountsAWakeUpThatMissedAPeriodAsAnOverrun) {
  Pacer pacer(100);
  pacer.begin(0);
  EXPECT_TRUE(pacer.in_time(10));
  EXPECT_EQ(pacer.next(199).overruns, 0U) << "late, but the next period can still be kept";
  EXPECT_TRUE(pacer.in_time(200));
  const Timing timing = pacer.next(450);
  EXPECT_EQ(timing.overruns, 1U);
  EXPECT_EQ(timing.skipped, 2U);
  EXPECT_EQ(pacer.due(), 500);
}

TEST(Pacer, FollowsARobotThatTicksByItsOwnClock) {
  Pacer pacer(100);
  pacer.begin(0);
  std::int64_t now = 0;
  for (int i = 0; i < 10'000; ++i) {
    now += 101;  // one per cent slower
    EXPECT_TRUE(pacer.in_time(now - 50));
    ASSERT_EQ(pacer.tick(now).skipped, 0U) << "no period is missed, however long it goes on";
    ASSERT_EQ(pacer.due(), now + 100);
  }
  now += 303;  // two ticks were lost
  EXPECT_TRUE(pacer.in_time(now - 250));
  EXPECT_EQ(pacer.tick(now).skipped, 2U);
  EXPECT_EQ(pacer.tick(now).overruns, 1U) << "one iteration was late, however many ticks were lost";
  EXPECT_TRUE(pacer.in_time(now));
  const Timing early = pacer.tick(now + 60);
  EXPECT_EQ(early.next_due, 0) << "a tick may come before its due time";
  EXPECT_EQ(early.skipped, 2U) << "an early tick is no harm";
  EXPECT_EQ(early.overruns, 1U);
}

TEST(Pacer, CountsATickWithoutAReadingAsAnOverrunAndSkipsNothing) {
  Pacer pacer(100);
  pacer.begin(0);
  EXPECT_TRUE(pacer.in_time(50));
  pacer.tick(120);
  const Timing timing = pacer.missed();
  EXPECT_EQ(timing.overruns, 1U);
  EXPECT_EQ(timing.skipped, 0U) << "the iteration was there, its reading was not";
  EXPECT_EQ(pacer.missed().overruns, 1U) << "an iteration counts once";
  EXPECT_TRUE(pacer.in_time(200));
  pacer.tick(220);
  EXPECT_EQ(pacer.missed().overruns, 2U);
}

TEST(Pacer, CountsAnIterationThatIsLateAndHasNoReadingOnce) {
  Pacer pacer(100);
  pacer.begin(0);
  EXPECT_FALSE(pacer.in_time(130));
  pacer.tick(330);
  EXPECT_EQ(pacer.missed().overruns, 1U);
  EXPECT_EQ(pacer.missed().skipped, 2U);
}

TEST(Pacer, CountsHowFarARobotThatTicksRunsAheadOfTheClock) {
  Pacer pacer(100);
  pacer.begin(0);
  for (int tick = 1; tick <= 10; ++tick) {
    pacer.tick(10 * tick);
    EXPECT_FALSE(pacer.runs_ahead()) << tick;
  }
  pacer.tick(110);
  EXPECT_FALSE(pacer.runs_ahead());
  pacer.tick(120);
  ASSERT_TRUE(pacer.runs_ahead()) << "twelve periods in little more than one";
  EXPECT_EQ(pacer.fast_ticks().ticks, 12);
  EXPECT_EQ(pacer.fast_ticks().time, 120);
}

TEST(Pacer, AllowsForSomeLateTicksAndForAFastClock) {
  Pacer pacer(1000);
  pacer.begin(0);
  std::int64_t now = 0;
  for (int i = 0; i < 100'000; ++i) {
    now += 985;  // one and a half per cent faster
    pacer.tick(now);
    ASSERT_FALSE(pacer.runs_ahead()) << i;
  }
  for (int gap = 0; gap < 100; ++gap) {
    now += 10'000;  // then the nine that were late come at once, and the next in time
    pacer.tick(now);
    for (int i = 0; i < 9; ++i) pacer.tick(now += 1);
    ASSERT_FALSE(pacer.runs_ahead()) << gap;
  }
  now += 1'000'000;  // a long gap allows for no more
  for (int i = 0; i < 20; ++i) pacer.tick(now += 1);
  EXPECT_TRUE(pacer.runs_ahead());
}

TEST(SleepUntil, IsNotOverBeforeItsMoment) {
  const std::int64_t due = monotonic_now() + 2'000'000;
  while (!sleep_until(due)) {
  }
  EXPECT_GE(monotonic_now(), due);
  EXPECT_TRUE(sleep_until(0)) << "what is past is over at once";
}

}  // namespace
}  // namespace o80
