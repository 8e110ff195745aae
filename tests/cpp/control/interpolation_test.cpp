#include "control/interpolation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace o80 {
namespace {

TEST(Interpolation, SlopeAndCurvatureAreTheDerivativesOfTheMinimumJerk) {
  constexpr double kStep = 1e-4;
  for (double t = 0.05; t < 1.0; t += 0.05) {
    const double before = minimum_jerk(t - kStep);
    const double here = minimum_jerk(t);
    const double after = minimum_jerk(t + kStep);
    EXPECT_NEAR(minimum_jerk_slope(t), (after - before) / (2 * kStep), 1e-5);
    EXPECT_NEAR(minimum_jerk_curvature(t), (after - 2 * here + before) / (kStep * kStep), 1e-4);
  }
}

TEST(Interpolation, AFadingMotionBeginsAsAskedEndsAtRestAndNeverTurns) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int round = 0; round < 5000; ++round) {
    const Moment start{any(random), any(random) * 0.1};
    const double most = 1.0 + 100.0 * std::abs(any(random));
    const double up = 30.0 * std::abs(any(random));
    const double down = 30.0 * std::abs(any(random));
    const Fading fading = Fading::of(start, most, up, down);
    ASSERT_LE(fading.time, most);
    if (fading.time == 0.0) continue;
    ASSERT_EQ(fading.at(0.0).velocity, start.velocity);
    ASSERT_EQ(fading.at(0.0).acceleration, start.acceleration);
    ASSERT_NEAR(fading.at(fading.time * (1 - 1e-12)).velocity, 0.0, 1e-9);
    double before = 0.0;
    const double direction = fading.distance() > 0.0 ? 1.0 : -1.0;
    for (int i = 1; i <= 50; ++i) {
      const double t = fading.time * i / 50.0;
      ASSERT_GE((fading.position(t) - before) * direction, -1e-12) << round;
      ASSERT_NEAR(fading.at(t).velocity,
                  (fading.position(t + 1e-5) - fading.position(t - 1e-5)) / 2e-5, 1e-4);
      before = fading.position(t);
    }
    ASSERT_LE(fading.distance(), up * (1 + 1e-12));
    ASSERT_GE(fading.distance(), -down * (1 + 1e-12));
  }
}

TEST(Interpolation, TheHighestSpeedOfAFadingMotionAndAMinimumJerkIsABound) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int round = 0; round < 3000; ++round) {
    const double velocity = any(random);
    const double distance = 100.0 * any(random);
    const double n = 1.0 + 300.0 * std::abs(any(random));
    const Fading fading{velocity, 0.0, n};
    double peak = 0.0;
    for (int i = 0; i <= 500; ++i) {
      const double t = i / 500.0;
      peak = std::max(peak,
                      std::abs(fading.at(t * n).velocity + distance * minimum_jerk_slope(t) / n));
    }
    const double bound = highest_speed(velocity, distance, n);
    ASSERT_LE(peak, bound * (1 + 1e-9));
    if (velocity * distance > 0.0) {
      ASSERT_GT(peak, bound * 0.999) << "it is met";
    }
  }
}

TEST(Interpolation, ALinearMotionTakesAsManyIterationsAsItsSpeedNeeds) {
  EXPECT_EQ(linear_iterations(1.0, 0.1), 10);
  EXPECT_EQ(linear_iterations(-1.0, 0.1), 10);
  EXPECT_EQ(linear_iterations(1.01, 0.1), 11);
  EXPECT_EQ(linear_iterations(0.0, 0.1), 1);
  EXPECT_EQ(linear_iterations(0.3, 0.1), 3);
  EXPECT_EQ(linear_iterations(1.1 - 0.8, 0.1), 3) << "rounding asks for no iteration more";
  EXPECT_EQ(linear_iterations(1e300, 1e-300), kMostIterations);
}

TEST(Interpolation, AMinimumJerkFromRestPeaksAtFifteenEighthsOfTheMean) {
  EXPECT_EQ(minimum_jerk_iterations(10.0, 0.1875), 100);
  EXPECT_EQ(minimum_jerk_iterations(-10.0, 0.1874), 101);
  EXPECT_EQ(minimum_jerk_iterations(0.0, 1.0), 1);
  EXPECT_EQ(minimum_jerk_iterations(1e300, 1e-300), kMostIterations);
}

}  // namespace
}  // namespace o80
