#include "control/motion/fastest_motion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "control/motion/number_limiter.hpp"
#include "control/motion/number_plan.hpp"
#include "dice.hpp"

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

TEST(FastestMotionTest, ATargetTooFarForAPlanIsNotApproachedByTheMotionBefore) {
  NumberPlan plan;
  for (const double target : {-500.0, 1e6}) {
    PlanTask task;
    task.target = target;
    task.rates = {1e-6, 1e-8, std::numeric_limits<double>::infinity()};
    task.stop = VelocityChange(0.0, 0.0, task.rates);
    task.iterations = 3'000'000'000;
    plan.settle(plan.propose(task));
    double reached = 0.0;
    for (int i = 0; i < 1000; ++i) reached = plan.next();
    EXPECT_GT(reached * target, 0.0) << target;
  }
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

/// Motions that are cut, and go on to a target near the end of their stop or near their own target:
/// the last step, to the exact target, keeps the limits as all others do.
TEST(FastestMotionTest, FromAnyMotionEachStepKeepsTheLimits) {
  test::Dice dice(1);
  for (int seed = 0; seed < 20'000; ++seed) {
    Rates rates;
    rates.speed = dice.magnitude(1e-3, 0.4);
    rates.acceleration = rates.speed * dice.magnitude(0.007, 0.7);
    rates.jerk = rates.acceleration * dice.magnitude(0.05, 3);
    const double first = dice.real(-1, 1) * dice.magnitude(0.05, 50) * rates.speed * 20;
    FastestMotion before({}, first, rates);
    Moment now;
    const auto go_on = [&](FastestMotion& motion) {
      const double place = motion.next();
      const double speed = place - now.position;
      now = {place, speed, speed - now.speed};
    };
    const auto most = static_cast<double>(std::min<std::int64_t>(before.iterations(), 200));
    for (auto left = static_cast<int>(dice.real(0, most)); left > 0; --left) go_on(before);
    const double stop = VelocityChange(-now.speed, now.acceleration, rates).displacement();
    const double target = dice.real(0, 1) < 0.3 ? first
                          : dice.real(0, 1) < 0.5
                              ? now.position + dice.real(-1, 1) * rates.speed * 60
                              : now.position + stop + dice.real(-1, 1) * rates.speed;
    FastestMotion motion(now, target, rates);
    if (dice.real(0, 1) < 0.5)
      motion.stretch(motion.iterations() + static_cast<int>(dice.real(0, 4)));
    const double place = std::max(std::abs(now.position), std::abs(target));
    const double rounding = 1e-5 + 1e-13 * place / rates.jerk;
    for (std::int64_t left = motion.iterations() + 2; left > 0; --left) {
      const double acceleration = now.acceleration;
      go_on(motion);
      ASSERT_LE(std::abs(now.speed), rates.speed * (1 + rounding)) << seed;
      ASSERT_LE(std::abs(now.acceleration), rates.acceleration * (1 + rounding)) << seed;
      ASSERT_LE(std::abs(now.acceleration - acceleration), rates.jerk * (1 + rounding)) << seed;
    }
    EXPECT_EQ(now.position, target);
  }
}

}  // namespace
}  // namespace o80
