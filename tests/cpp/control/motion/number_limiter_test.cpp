#include "control/motion/number_limiter.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "dice.hpp"

namespace o80 {
namespace {

class NumberLimiterTest : public testing::Test, protected test::Dice {
 protected:
  NumberLimiterTest() : Dice(11) {}
  Rates any_rates() {
    Rates rates{magnitude(1e-3, 1.0), kNone, kNone};
    if (!one_in(4)) rates.acceleration = rates.speed * magnitude(0.01, 3.0);
    if (std::isfinite(rates.acceleration) && !one_in(3)) {
      rates.jerk = rates.acceleration * magnitude(0.03, 3.0);
    }
    return rates;
  }
  /// Follows one random course with both; `freely`: with brakes, and to places far away.
  template <class See>
  void expect_same_moves(NumberLimiter limiter, NumberLimiter general, bool freely, See&& see) {
    const double start = real(-2, 2);
    limiter.restart(start);
    general.restart(start);
    double wanted = start;
    for (int i = 0; i < 50; ++i) {
      if (one_in(10)) limiter.begin(), general.begin();
      if (freely && one_in(10)) limiter.brake(), general.brake();
      if (!one_in(4))
        wanted = one_in(3) ? real(-2, 2) : wanted + real(-1, 1) * magnitude(1e-17, 1.0);
      if (freely && one_in(100)) wanted = real(-9e306, 9e306);
      const Limit limit = limiter.follow(wanted);
      ASSERT_EQ(limit, general.follow(wanted));
      ASSERT_EQ(limiter.position(), general.position());
      ASSERT_EQ(limiter.moment().speed, general.moment().speed);
      ASSERT_EQ(limiter.moment().acceleration, general.moment().acceleration);
      see(limit, limiter.moment().speed);
    }
  }

  static constexpr double kNone = std::numeric_limits<double>::infinity();
};

TEST_F(NumberLimiterTest, WithoutAnAccelerationLimitMovesBitForBitAsWithAnEnormousOne) {
  std::array<int, 6> limits{};
  for (int round = 0; round < 2000; ++round) {
    const double speed = magnitude(0.01, 10.0);
    const double minimum = one_in(4) ? -kNone : real(-1, 0);
    const double maximum = one_in(4) ? kNone : real(0, 1);
    expect_same_moves({minimum, maximum, {speed, kNone, kNone}},
                      {minimum, maximum, {speed, 1e300, kNone}}, false,
                      [&](Limit limit, double) { ++limits[static_cast<std::size_t>(limit)]; });
  }
  for (const Limit limit : {Limit::none, Limit::minimum, Limit::maximum, Limit::speed}) {
    EXPECT_GT(limits[static_cast<std::size_t>(limit)], 100) << static_cast<int>(limit);
  }
}

TEST_F(NumberLimiterTest, WithoutAnyLimitMovesBitForBitAsWithEnormousBounds) {
  constexpr double kMax = std::numeric_limits<double>::max();
  int stops = 0;
  for (int round = 0; round < 2000; ++round) {
    expect_same_moves({-kMax, kMax, {kNone, kNone, kNone}}, {-1e307, 1e307, {kNone, kNone, kNone}},
                      true, [&](Limit, double speed) { stops += speed == 0.0 ? 1 : 0; });
  }
  EXPECT_GT(stops, 100);
}

TEST_F(NumberLimiterTest, WithoutAnyLimitGoesWithinTheRangeOfADouble) {
  constexpr double kMax = std::numeric_limits<double>::max();
  NumberLimiter limiter(-kMax, kMax, {kNone, kNone, kNone});
  limiter.restart(-kMax);
  for (int i = 0; i < 3; ++i) limiter.follow(kMax);
  EXPECT_TRUE(std::isfinite(limiter.position()));
}

TEST_F(NumberLimiterTest, FollowsExactlyWhatLiesWithinItsLimits) {
  NumberLimiter limiter(-1, 1, {0.02, 0.001, 0.0001});
  limiter.restart(0.0);
  // a minimum jerk to the bound: peak speed 0.0094, acceleration 1.4e-4, jerk 1.5e-6
  for (int i = 1; i <= 200; ++i) {
    const double t = i / 200.0;
    const double wanted = t * t * t * (10 - 15 * t + 6 * t * t);
    ASSERT_EQ(limiter.follow(wanted), Limit::none) << i;
    ASSERT_EQ(limiter.position(), wanted);
  }
  limiter.brake();
  EXPECT_EQ(limiter.position(), 1.0);
}

TEST_F(NumberLimiterTest, CatchesUpWithAMotionItLostAndStaysWithIt) {
  for (int round = 0; round < 300; ++round) {
    Rates rates = any_rates();
    NumberLimiter limiter(-kNone, kNone, rates);
    limiter.restart(0.0);
    const double speed = rates.speed * real(-0.9, 0.9);
    double wanted = std::isfinite(rates.acceleration) ? real(-3, 3) * rates.speed : 0.0;
    int tracked = 0;
    for (int i = 0; i < 20'000 && tracked < 10; ++i) {
      wanted += speed;
      const Limit reason = limiter.follow(wanted);
      ASSERT_EQ(reason == Limit::none, limiter.position() == wanted);
      tracked = limiter.position() == wanted ? tracked + 1 : 0;
    }
    ASSERT_EQ(tracked, 10) << round << ": speed " << rates.speed << ", acceleration "
                           << rates.acceleration << ", jerk " << rates.jerk << ", lag "
                           << limiter.position() - wanted;
  }
}

TEST_F(NumberLimiterTest, OutsideItsBoundsMovesOnlyInward) {
  NumberLimiter limiter(-1, 1, {0.1, kNone, kNone});
  limiter.restart(1.2);
  limiter.begin();
  EXPECT_EQ(limiter.follow(1.199), Limit::none) << "also to a place that is still outside";
  EXPECT_NE(limiter.follow(1.3), Limit::none);
  EXPECT_EQ(limiter.position(), 1.199);
  limiter.follow(0.5);
  EXPECT_NEAR(limiter.position(), 1.099, 1e-12);
}

TEST_F(NumberLimiterTest, SaysWhichLimitHeldItBack) {
  NumberLimiter limiter(-1, 1, {0.02, 0.01, kNone});
  limiter.restart(0.0);
  EXPECT_EQ(limiter.follow(1.0), Limit::acceleration);
  EXPECT_EQ(limiter.follow(1.0), Limit::speed);
  NumberLimiter bounded(-1, 1, {kNone, kNone, kNone});
  bounded.restart(0.0);
  EXPECT_EQ(bounded.follow(2.0), Limit::maximum);
  EXPECT_EQ(bounded.follow(-2.0), Limit::minimum);
  NumberLimiter gentle(-1, 1, {0.02, 0.01, 0.001});
  gentle.restart(0.0);
  EXPECT_EQ(gentle.follow(1.0), Limit::jerk);
}

}  // namespace
}  // namespace o80
