#include "o80/control/interpolation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace o80 {
namespace {

double sampled_peak(const Quintic& quintic) {
  double peak = 0.0;
  for (int i = 0; i <= 2000; ++i) {
    peak = std::max(peak, std::abs(quintic.at(QuinticWeights::slope(i / 2000.0))));
  }
  return peak;
}

TEST(Interpolation, AQuinticBeginsAsAskedAndEndsAtRest) {
  const Quintic quintic = Quintic::from(3.0, {0.0, 0.5, -0.02}, 10.0);
  EXPECT_DOUBLE_EQ(quintic.at(QuinticWeights::position(0.0)), 0.0);
  EXPECT_DOUBLE_EQ(quintic.at(QuinticWeights::slope(0.0)), 5.0);
  EXPECT_DOUBLE_EQ(quintic.at(QuinticWeights::curvature(0.0)), -2.0);
  EXPECT_DOUBLE_EQ(quintic.at(QuinticWeights::position(1.0)), 3.0);
  EXPECT_NEAR(quintic.at(QuinticWeights::slope(1.0)), 0.0, 1e-12);
  EXPECT_NEAR(quintic.at(QuinticWeights::curvature(1.0)), 0.0, 1e-12);
}

TEST(Interpolation, SlopeAndCurvatureAreTheDerivativesOfThePosition) {
  const Quintic quintic = Quintic::from(3.0, {0.0, 0.5, -0.02}, 10.0);
  constexpr double kStep = 1e-4;
  for (int i = 1; i < 20; ++i) {
    const double t = 0.05 * i;
    const double before = quintic.at(QuinticWeights::position(t - kStep));
    const double here = quintic.at(QuinticWeights::position(t));
    const double after = quintic.at(QuinticWeights::position(t + kStep));
    EXPECT_NEAR(quintic.at(QuinticWeights::slope(t)), (after - before) / (2 * kStep), 1e-5);
    EXPECT_NEAR(quintic.at(QuinticWeights::curvature(t)),
                (after - 2 * here + before) / (kStep * kStep), 1e-4);
  }
}

TEST(Interpolation, ThePeakSpeedFromRestIsFifteenEighthsOfTheMean) {
  EXPECT_DOUBLE_EQ(peak_speed({4.0, 0.0, 0.0}), 1.875 * 4.0);
  EXPECT_DOUBLE_EQ(peak_speed({0.0, 0.0, 0.0}), 0.0);
}

TEST(Interpolation, ThePeakSpeedIsThatOfTheWholeWay) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> any(-10.0, 10.0);
  for (int i = 0; i < 5000; ++i) {
    const Quintic quintic{any(random), any(random), any(random) * 3.0};
    const double sampled = sampled_peak(quintic);
    ASSERT_GE(peak_speed(quintic), sampled - 1e-9);
    ASSERT_LE(peak_speed(quintic), sampled * (1.0 + 1e-4) + 1e-4);
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

TEST(Interpolation, AMinimumJerkMotionTakesTheFewestIterationsItsPeakAllows) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int i = 0; i < 3000; ++i) {
    const double distance = 100.0 * any(random);
    const Moment start{0.0, any(random), 0.0};
    const double speed = std::abs(start.velocity) + 0.01 + std::abs(any(random));
    const std::int64_t n = minimum_jerk_iterations(distance, start, speed);
    const auto peak = [&](std::int64_t iterations) {
      const auto count = static_cast<double>(iterations);
      return peak_speed(Quintic::from(distance, start, count)) / count;
    };
    ASSERT_LE(peak(n), speed * (1.0 + 1e-9));
    if (n > 1) {
      ASSERT_GT(peak(n - 1), speed * (1.0 - 1e-9));
    }
  }
}

TEST(Interpolation, AMotionThatIsTooFastAlreadyMayNotBecomeFaster) {
  const std::int64_t n = minimum_jerk_iterations(10.0, {0.0, 1.0, 0.0}, 0.1);
  const auto count = static_cast<double>(n);
  EXPECT_LE(peak_speed(Quintic::from(10.0, {0.0, 1.0, 0.0}, count)) / count, 1.0 + 1e-9);
}

TEST(Interpolation, TheSearchEndsWhateverTheMotionStartsWith) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> exponent(-200.0, 200.0);
  std::uniform_int_distribution<int> sign(0, 1);
  const auto any = [&] {
    return (sign(random) == 0 ? -1.0 : 1.0) * std::pow(10.0, exponent(random));
  };
  for (int i = 0; i < 20'000; ++i) {
    const std::int64_t n = minimum_jerk_iterations(any(), {0.0, any(), any()}, std::abs(any()));
    ASSERT_GE(n, 1);
    ASSERT_LE(n, kMostIterations);
  }
  const double acceleration = 50.0;  // no number of iterations keeps it below the speed
  EXPECT_GE(minimum_jerk_iterations(1.0, {0.0, 0.1, acceleration}, 0.1), 1);
}

}  // namespace
}  // namespace o80
