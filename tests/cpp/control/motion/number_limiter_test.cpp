#include "control/motion/number_limiter.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace o80 {
namespace {

class NumberLimiterTest : public testing::Test {
 protected:
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double magnitude(double low, double high) { return std::pow(10.0, real(low, high)); }
  bool one_in(int n) { return std::uniform_int_distribution<int>(1, n)(random_) == 1; }
  Rates any_rates() {
    Rates rates{magnitude(-3, 0), std::numeric_limits<double>::infinity(),
                std::numeric_limits<double>::infinity()};
    if (!one_in(4)) rates.acceleration = rates.speed * magnitude(-2, 0.5);
    if (std::isfinite(rates.acceleration) && !one_in(3)) {
      rates.jerk = rates.acceleration * magnitude(-1.5, 0.5);
    }
    return rates;
  }

  std::mt19937_64 random_{11};
};

/// Watches the differences of a limiter's positions.
struct Witness {
  const NumberLimiter& limiter;
  double position = limiter.position();
  double speed = 0.0;
  double acceleration = 0.0;

  void look() {
    const Rates& rates = limiter.rates();
    const double rounding = 1e-14 * (std::abs(position) + std::abs(limiter.position()) + 1e-3);
    const double next_speed = limiter.position() - position;
    const double next_acceleration = next_speed - speed;
    ASSERT_TRUE(std::isfinite(limiter.position()));
    ASSERT_LE(limiter.position(), std::max(limiter.maximum(), position));
    ASSERT_GE(limiter.position(), std::min(limiter.minimum(), position));
    ASSERT_LE(std::abs(next_speed), rates.speed * (1 + 1e-6) + rounding);
    ASSERT_LE(std::abs(next_acceleration), rates.acceleration * (1 + 1e-6) + 4 * rounding);
    ASSERT_LE(std::abs(next_acceleration - acceleration), rates.jerk * (1 + 1e-5) + 16 * rounding);
    position = limiter.position();
    speed = next_speed;
    acceleration = next_acceleration;
  }
};

TEST_F(NumberLimiterTest, WithoutAnAccelerationLimitMovesBitForBitAsWithAnEnormousOne) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  constexpr double kEnormous = 1e300;
  std::array<int, 6> limits{};
  for (int round = 0; round < 2000; ++round) {
    const double speed = magnitude(-2, 1);
    const double minimum = one_in(4) ? -kNone : real(-1, 0);
    const double maximum = one_in(4) ? kNone : real(0, 1);
    NumberLimiter limiter(minimum, maximum, {speed, kNone, kNone});
    NumberLimiter general(minimum, maximum, {speed, kEnormous, kNone});
    const double start = real(-2, 2);
    limiter.restart(start);
    general.restart(start);
    double wanted = start;
    for (int i = 0; i < 50; ++i) {
      if (one_in(10)) limiter.begin(), general.begin();
      if (!one_in(4)) wanted = one_in(3) ? real(-2, 2) : wanted + real(-1, 1) * magnitude(-17, 0);
      const Limit limit = limiter.follow(wanted);
      ASSERT_EQ(limit, general.follow(wanted)) << round;
      ASSERT_EQ(limiter.position(), general.position()) << round;
      ASSERT_EQ(limiter.moment().speed, general.moment().speed) << round;
      ASSERT_EQ(limiter.moment().acceleration, general.moment().acceleration) << round;
      ++limits[static_cast<std::size_t>(limit)];
    }
  }
  for (const Limit limit : {Limit::none, Limit::minimum, Limit::maximum, Limit::speed}) {
    EXPECT_GT(limits[static_cast<std::size_t>(limit)], 100) << static_cast<int>(limit);
  }
}

TEST_F(NumberLimiterTest, WithoutAnyLimitMovesBitForBitAsWithEnormousBounds) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  constexpr double kMax = std::numeric_limits<double>::max();
  int stops = 0;
  for (int round = 0; round < 2000; ++round) {
    NumberLimiter limiter(-kMax, kMax, {kNone, kNone, kNone});
    NumberLimiter general(-1e307, 1e307, {kNone, kNone, kNone});
    const double start = real(-2, 2);
    limiter.restart(start);
    general.restart(start);
    double wanted = start;
    for (int i = 0; i < 50; ++i) {
      if (one_in(10)) limiter.begin(), general.begin();
      if (one_in(10)) limiter.brake(), general.brake();
      if (!one_in(4)) wanted = one_in(3) ? real(-2, 2) : wanted + real(-1, 1) * magnitude(-17, 0);
      if (one_in(100)) wanted = real(-9e306, 9e306);
      ASSERT_EQ(limiter.follow(wanted), general.follow(wanted)) << round;
      ASSERT_EQ(limiter.position(), general.position()) << round;
      ASSERT_EQ(limiter.moment().speed, general.moment().speed) << round;
      ASSERT_EQ(limiter.moment().acceleration, general.moment().acceleration) << round;
      stops += limiter.moment().speed == 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(stops, 100);
}

TEST_F(NumberLimiterTest, WithoutAnyLimitGoesWithinTheRangeOfADouble) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  constexpr double kMax = std::numeric_limits<double>::max();
  NumberLimiter limiter(-kMax, kMax, {kNone, kNone, kNone});
  limiter.restart(-kMax);
  for (int i = 0; i < 3; ++i) limiter.follow(kMax);
  EXPECT_TRUE(std::isfinite(limiter.position()));
}

TEST_F(NumberLimiterTest, KeepsItsLimitsWhateverItIsAskedToFollow) {
  for (int round = 0; round < 3000; ++round) {
    const double minimum = one_in(4) ? -std::numeric_limits<double>::infinity() : real(-1, 0);
    const double maximum = one_in(4) ? std::numeric_limits<double>::infinity() : real(0, 1);
    NumberLimiter limiter(minimum, maximum, any_rates());
    limiter.restart(one_in(5) ? real(-2, 2) : std::clamp(real(-1, 1), minimum, maximum));
    Witness witness{limiter};
    for (int part = 0; part < 12; ++part) {
      const int kind = static_cast<int>(real(0, 5));
      const double target = std::clamp(real(-1, 1), minimum, maximum);
      const int length = static_cast<int>(magnitude(0, 2.2));
      const double start = limiter.position();
      if (one_in(2)) limiter.begin();
      for (int i = 1; i <= length; ++i) {
        const double share = static_cast<double>(i) / length;
        if (kind == 0) {
          limiter.follow(target);
        } else if (kind == 1) {
          limiter.follow(start + (target - start) * share);
        } else if (kind == 2) {
          limiter.follow(start + (target - start) * share * share * (3 - 2 * share));
        } else if (kind == 3) {
          limiter.follow(real(-1, 1));
        } else {
          limiter.brake();
        }
        ASSERT_NO_FATAL_FAILURE(witness.look())
            << "round " << round << " part " << part << " kind " << kind << " at " << i;
      }
    }
    for (int i = 0; i < 100'000 && !limiter.at_rest(); ++i) {
      limiter.brake();
      ASSERT_NO_FATAL_FAILURE(witness.look()) << "round " << round << " while it brakes";
    }
    ASSERT_TRUE(limiter.at_rest());
  }
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
    NumberLimiter limiter(-std::numeric_limits<double>::infinity(),
                          std::numeric_limits<double>::infinity(), rates);
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
  NumberLimiter limiter(
      -1, 1,
      {0.1, std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()});
  limiter.restart(1.2);
  limiter.begin();
  EXPECT_EQ(limiter.follow(1.199), Limit::none) << "also to a place that is still outside";
  EXPECT_NE(limiter.follow(1.3), Limit::none);
  EXPECT_EQ(limiter.position(), 1.199);
  limiter.follow(0.5);
  EXPECT_NEAR(limiter.position(), 1.099, 1e-12);
}

TEST_F(NumberLimiterTest, SaysWhichLimitHeldItBack) {
  NumberLimiter limiter(-1, 1, {0.02, 0.01, std::numeric_limits<double>::infinity()});
  limiter.restart(0.0);
  EXPECT_EQ(limiter.follow(1.0), Limit::acceleration);
  EXPECT_EQ(limiter.follow(1.0), Limit::speed);
  NumberLimiter bounded(
      -1, 1,
      {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
       std::numeric_limits<double>::infinity()});
  bounded.restart(0.0);
  EXPECT_EQ(bounded.follow(2.0), Limit::maximum);
  EXPECT_EQ(bounded.follow(-2.0), Limit::minimum);
  NumberLimiter gentle(-1, 1, {0.02, 0.01, 0.001});
  gentle.restart(0.0);
  EXPECT_EQ(gentle.follow(1.0), Limit::jerk);
}

}  // namespace
}  // namespace o80
