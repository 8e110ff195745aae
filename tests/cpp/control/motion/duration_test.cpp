#include "control/motion/duration.hpp"

#include <gtest/gtest.h>

#include <random>

namespace o80 {
namespace {

TEST(DurationCarry, RoundsToNearestHalvesUp) {
  EXPECT_EQ(DurationCarry(10).iterations(14), 1);
  EXPECT_EQ(DurationCarry(10).iterations(15), 2);
  EXPECT_EQ(DurationCarry(10).iterations(16), 2);
  EXPECT_EQ(DurationCarry(7).iterations(10), 1);
  EXPECT_EQ(DurationCarry(7).iterations(11), 2);
}

TEST(DurationCarry, TakesAtLeastOneIterationAndMakesUpForItLater) {
  DurationCarry carry(10);
  EXPECT_EQ(carry.iterations(0), 1);
  EXPECT_EQ(carry.iterations(4), 1) << "16 too many by now";
  EXPECT_EQ(carry.iterations(36), 2) << "the exact end is 40";
  EXPECT_EQ(carry.iterations(10), 1);
}

TEST(DurationCarry, PassesWhatIsOverBeforeTheNextIteration) {
  DurationCarry carry(10);
  EXPECT_TRUE(carry.pass(4));
  EXPECT_FALSE(carry.pass(2)) << "6 is nearer to the first iteration than to none";
  EXPECT_EQ(carry.iterations(16), 2) << "the exact end is 20";
}

// rule C6
TEST(DurationCarry, ItsSumIsTheRoundedSumOfAllDurations) {
  std::mt19937_64 random(1);
  for (const std::int64_t period : {1LL, 2LL, 3LL, 1'000'000LL, 1'234'567LL, 2'000'000LL}) {
    std::uniform_int_distribution<std::int64_t> any(period, 20 * period);
    DurationCarry carry(period);
    std::int64_t exact = 0;
    std::int64_t iterations = 0;
    for (int i = 0; i < 10'000; ++i) {
      const std::int64_t duration = any(random);
      exact += duration;
      iterations += carry.iterations(duration);
      const std::int64_t error = 2 * (exact - iterations * period);
      ASSERT_LE(error < 0 ? -error : error, period);
    }
  }
}

TEST(DurationCarry, ForgetsWhenReset) {
  DurationCarry carry(10);
  EXPECT_EQ(carry.iterations(14), 1);
  carry.reset();
  EXPECT_EQ(carry.iterations(14), 1);
  EXPECT_EQ(carry.iterations(14), 2);
}

}  // namespace
}  // namespace o80
