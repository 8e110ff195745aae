#include "control/motion/velocity_change.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dice.hpp"

namespace o80 {
namespace {

class VelocityChangeTest : public testing::Test, protected test::Dice {
 protected:
  VelocityChangeTest() : Dice(7) {}
};

TEST_F(VelocityChangeTest, EndsAtRestWithinItsLimitsAndKnowsHowFarItGets) {
  for (int round = 0; round < 200'000; ++round) {
    Rates rates{std::numeric_limits<double>::infinity(), magnitude(1e-4, 1e2),
                std::numeric_limits<double>::infinity()};
    const bool jerk = real(0, 1) < 0.7;
    if (jerk) rates.jerk = rates.acceleration * magnitude(3e-3, 10.0);
    double start = jerk ? real(-1, 1) * rates.acceleration : 0.0;
    if (real(0, 1) < 0.1) start = 0.0;
    if (jerk && real(0, 1) < 0.1) start = rates.jerk * std::round(real(-3, 3));
    if (std::abs(start) > rates.acceleration) start = 0.0;
    const double change = real(-1, 1) * rates.acceleration * magnitude(1e-3, 3e2);

    const VelocityChange plan(change, start, rates);
    double speed = -change;  // what is left
    double before = start;
    double displacement = 0.0;
    double away = 0.0;
    double position = 0.0;
    double turned = 0.0;
    bool turning = true;
    for (std::int64_t i = 1; i <= plan.steps(); ++i) {
      const double a = plan.acceleration(i);
      ASSERT_LE(std::abs(a), rates.acceleration * (1 + 1e-12)) << round;
      if (jerk) {
        ASSERT_LE(std::abs(a - before), rates.jerk * (1 + 1e-9)) << round << " at " << i;
      }
      before = a;
      speed += a;
      displacement += speed;
      position += speed;
      if (plan.detour() != 0.0) {
        away = std::max(away, (speed + change) * std::copysign(1.0, plan.detour()));
      }
      turning = turning && speed * change < 0.0;
      if (turning) turned = position;
    }
    if (jerk) {
      ASSERT_NEAR(before, 0.0, rates.jerk * 1e-9);
    }
    const double steps = static_cast<double>(plan.steps());
    ASSERT_NEAR(speed, 0.0, 1e-12 * (steps + 1) * (std::abs(change) + rates.acceleration)) << round;
    ASSERT_NEAR(displacement, plan.displacement(),
                1e-11 * (steps + 1) * (steps + 1) * (std::abs(change) + rates.acceleration))
        << round << " of " << steps;
    ASSERT_NEAR(away, std::abs(plan.detour()), 1e-9 * (away + rates.acceleration)) << round;
    if (plan.detour() != 0.0 && plan.detour() * change > 0) {
      // it comes from beyond its target: position turns once on the way
      ASSERT_NEAR(turned, plan.run_before_turn(-change),
                  std::abs(change) * 1e-9 + 1e-9 * std::abs(turned))
          << round;
    }
  }
}

TEST_F(VelocityChangeTest, TakesTheFewestIterations) {
  for (int round = 0; round < 20'000; ++round) {
    const double acceleration = magnitude(1e-2, 1e2);
    const Rates rates{std::numeric_limits<double>::infinity(), acceleration,
                      acceleration * magnitude(0.03, 3.0)};
    const double start = real(-1, 1) * acceleration;
    const double change = real(-1, 1) * acceleration * magnitude(1e-2, 30.0);
    const VelocityChange plan(change, start, rates);
    // with one iteration less not even the extremes reach it
    const auto steps = static_cast<double>(plan.steps() - 1);
    if (steps * rates.jerk < std::abs(start)) continue;
    double least = 0.0;
    double most = 0.0;
    for (double i = 1; i < steps; ++i) {
      least += std::max({-acceleration, start - i * rates.jerk, -(steps - i) * rates.jerk});
      most += std::min({acceleration, start + i * rates.jerk, (steps - i) * rates.jerk});
    }
    ASSERT_TRUE(change < least + 1e-9 * acceleration || change > most - 1e-9 * acceleration)
        << round << ": " << plan.steps();
  }
}

TEST_F(VelocityChangeTest, WithoutAccelerationLimitIsDoneAtOnce) {
  const VelocityChange plan(
      -3.0, 0.0,
      {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
       std::numeric_limits<double>::infinity()});
  EXPECT_EQ(plan.steps(), 1);
  EXPECT_EQ(plan.acceleration(1), -3.0);
  EXPECT_EQ(plan.displacement(), 0.0);
  EXPECT_EQ(VelocityChange(0.0, 0.0, {std::numeric_limits<double>::infinity(), 1.0, 1.0}).steps(),
            0);
}

}  // namespace
}  // namespace o80
