#include "control/motion/fastest_motion.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "control/motion/number_limiter.hpp"

namespace o80 {
namespace {

TEST(FastestMotionTest, FromRestToRestTakesTheKnownTime) {
  // 100 iterations up to full speed, 900 at it, 100 down
  const Rates rates{0.1, 0.001, std::numeric_limits<double>::infinity()};
  EXPECT_EQ(FastestMotion({}, 100.0, rates).iterations(), 1100);
  // acceleration, no cruise: 2 sqrt(d / a)
  EXPECT_EQ(FastestMotion({}, 2.5, rates).iterations(), 100);
  // jerk only: 4 (d / 2 j)^(1/3)
  EXPECT_EQ(FastestMotion({}, -0.25, {10.0, 10.0, 1e-6}).iterations(), 200);
  EXPECT_EQ(FastestMotion({1.0}, 1.0, rates).iterations(), 1);
}

TEST(FastestMotionTest, LetsGoOfTheBrakeForATargetJustBeyondTheWayToRest) {
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

}  // namespace
}  // namespace o80
