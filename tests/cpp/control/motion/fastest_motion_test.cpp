#include "control/motion/fastest_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "control/motion/number_limiter.hpp"

namespace o80 {
namespace {

class FastestMotionTest : public testing::Test {
 protected:
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double magnitude(double low, double high) { return std::pow(10.0, real(low, high)); }
  Rates any_rates() {
    Rates rates{magnitude(-3, 0), std::numeric_limits<double>::infinity(),
                std::numeric_limits<double>::infinity()};
    rates.acceleration = rates.speed * magnitude(-2, 0.5);
    if (real(0, 1) < 0.7) rates.jerk = rates.acceleration * magnitude(-1.5, 0.5);
    return rates;
  }
  std::mt19937_64 random_{5};
};

TEST_F(FastestMotionTest, IsFollowedByALimiterThatNeverHoldsItBackFromWhereverItStarts) {
  std::int64_t longest = 0;
  for (int round = 0; round < 20'000; ++round) {
    const Rates rates = any_rates();
    NumberLimiter limiter(-std::numeric_limits<double>::infinity(),
                          std::numeric_limits<double>::infinity(), rates);
    limiter.restart(real(-1, 1));
    for (int part = 0; part < 4; ++part) {
      const double target =
          real(0, 1) < 0.1 ? limiter.position() : real(-1, 1) * magnitude(-3, 0.5);
      FastestMotion motion(limiter.moment(), target, rates);
      limiter.begin();
      const auto n = motion.iterations();
      longest = std::max(longest, n);
      ASSERT_LT(n, 3 + 4e3 * 3.3 / rates.speed) << round;
      const auto cut =
          part == 3 ? n : static_cast<std::int64_t>(real(0, 1.2) * static_cast<double>(n)) + 1;
      for (std::int64_t i = 1; i <= cut; ++i) {
        const double wanted = motion.next();
        ASSERT_EQ(limiter.follow(wanted), Limit::none)
            << "round " << round << ", part " << part << ", iteration " << i << " of " << n
            << ": wanted " << wanted << ", got " << limiter.position() << ", rates " << rates.speed
            << " " << rates.acceleration << " " << rates.jerk;
      }
      if (cut >= n) {
        ASSERT_EQ(limiter.position(), target);

        limiter.brake();
        ASSERT_EQ(limiter.position(), target) << "it rests there";
        ASSERT_TRUE(limiter.at_rest());
      }
    }
  }
  EXPECT_GT(longest, 1000);
}

TEST_F(FastestMotionTest, FromRestToRestTakesTheKnownTime) {
  // 100 iterations up to full speed, 900 at it, 100 down
  const Rates rates{0.1, 0.001, std::numeric_limits<double>::infinity()};
  EXPECT_EQ(FastestMotion({}, 100.0, rates).iterations(), 1100);
  // acceleration, no cruise: 2 sqrt(d / a)
  EXPECT_EQ(FastestMotion({}, 2.5, rates).iterations(), 100);
  // jerk only: 4 (d / 2 j)^(1/3)
  EXPECT_EQ(FastestMotion({}, -0.25, {10.0, 10.0, 1e-6}).iterations(), 200);
  EXPECT_EQ(FastestMotion({1.0}, 1.0, rates).iterations(), 1);
}

TEST_F(FastestMotionTest, LetsGoOfTheBrakeForATargetJustBeyondTheWayToRest) {
  // 36.4 iterations are the fewest in continuous time
  const Rates rates{0.00357, 1.756e-4, 8.529e-6};
  NumberLimiter limiter(-1.0, 1.0, rates);
  limiter.restart(0.0);
  FastestMotion first({}, 0.115629, rates);
  limiter.begin();
  for (int i = 0; i < 49; ++i) limiter.follow(first.next());

  FastestMotion second(limiter.moment(), 0.136052, rates);

  EXPECT_LE(second.iterations(), 38);
  limiter.begin();
  for (std::int64_t i = second.iterations(); i > 0; --i)
    ASSERT_EQ(limiter.follow(second.next()), Limit::none);
  EXPECT_EQ(limiter.position(), 0.136052);
}

TEST_F(FastestMotionTest, StretchesToEndWithASlowerOne) {
  int exact = 0;
  for (int round = 0; round < 3000; ++round) {
    const Rates rates = any_rates();
    NumberLimiter limiter(-std::numeric_limits<double>::infinity(),
                          std::numeric_limits<double>::infinity(), rates);
    limiter.restart(0.0);
    FastestMotion first({}, real(-1, 1), rates);
    limiter.begin();
    for (auto i = static_cast<std::int64_t>(real(0, 1) * static_cast<double>(first.iterations()));
         i > 0; --i)
      limiter.follow(first.next());
    const double target = real(-1, 1);
    FastestMotion motion(limiter.moment(), target, rates);
    const auto n =
        static_cast<std::int64_t>(static_cast<double>(motion.iterations()) * real(1, 3)) + 1;
    motion.stretch(n);
    ASSERT_LE(motion.iterations(), n);
    exact += motion.iterations() == n ? 1 : 0;
    limiter.begin();
    for (std::int64_t i = 1; i <= n; ++i) ASSERT_EQ(limiter.follow(motion.next()), Limit::none);
    ASSERT_EQ(limiter.position(), target);
  }
  EXPECT_GT(exact, 2900);
}

}  // namespace
}  // namespace o80
