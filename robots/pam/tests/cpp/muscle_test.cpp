#include "pam/muscle.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "pam/bracketed_root.hpp"

namespace o80::pam {
namespace {

constexpr double kMilli = 1e-3;

TEST(BracketedRoot, FindsWhereAnyCurveCrossesZero) {
  EXPECT_DOUBLE_EQ(bracketed_root([](double x) { return x * x - 2.0; }, 0.0, 2.0), std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(bracketed_root([](double x) { return std::exp(-50.0 * x) - 0.5; }, 0.0, 10.0),
                   std::log(2.0) / 50.0);
  EXPECT_DOUBLE_EQ(bracketed_root([](double x) { return x < 0.3 ? -1.0 : 1.0; }, 0.0, 1.0), 0.3);
}

TEST(LinearMuscle, PullsInProportionToPressure) {
  const LinearMuscle muscle;
  EXPECT_DOUBLE_EQ(muscle.resting_force(0.68, 0.0), 0.0);
  EXPECT_NEAR(muscle.resting_force(0.68, 1.0), 1200.0, 1e-9);
  EXPECT_NEAR(muscle.resting_force(0.68, 0.25), 300.0, 1e-9);
}

TEST(LinearMuscle, PullsLessTheMoreItIsContractedAndNeverPushes) {
  const LinearMuscle muscle;
  EXPECT_DOUBLE_EQ(muscle.resting_force(muscle.full_force_length, 1.0), muscle.maximum_force);
  EXPECT_NEAR(muscle.resting_force(0.65, 1.0), 750.0, 1e-9);
  EXPECT_DOUBLE_EQ(muscle.resting_force(0.55, 1.0), 0.0);
}

TEST(HillMuscle, HasItsFullIsometricForceAtTheOptimalLengthOnly) {
  const HillMuscle muscle;
  const auto& p = muscle.parameters();
  EXPECT_DOUBLE_EQ(muscle.isometric(p.optimal_length), 1.0);
  EXPECT_DOUBLE_EQ(muscle.contractile_force(p.optimal_length, 0.0, 1.0), p.maximum_force);
  for (double share : {0.3, 0.7, 0.9, 1.2, 1.5}) {
    EXPECT_LT(muscle.isometric(share * p.optimal_length), 1.0) << share;
  }
  // by definition of the widths the bell falls to 1/e there
  EXPECT_NEAR(muscle.isometric((1.0 - p.width_ascending) * p.optimal_length), std::exp(-1), 1e-12);
  EXPECT_NEAR(muscle.isometric((1.0 + p.width_descending) * p.optimal_length), std::exp(-1), 1e-12);
}

TEST(HillMuscle, IsometricForceIsTheActivationTimesTheBell) {
  const HillMuscle muscle;
  for (double length : {0.18, 0.22, 0.26, 0.30}) {
    for (double activation : {0.1, 0.5, 1.0}) {
      EXPECT_NEAR(muscle.contractile_force(length, 0.0, activation),
                  1500.0 * activation * muscle.isometric(length), 1e-9);
    }
  }
}

TEST(HillMuscle, ParallelElasticElementCarriesItsPublishedForceAtTheEndOfTheBell) {
  const HillMuscle muscle;
  const auto& p = muscle.parameters();
  EXPECT_EQ(muscle.parallel_force(p.parallel_rest * p.optimal_length), 0.0);
  EXPECT_NEAR(muscle.parallel_force((1.0 + p.width_descending) * p.optimal_length),
              p.parallel_force * p.maximum_force, 1e-6);
}

TEST(HillMuscle, SeriesElasticElementIsSlackThenCurvedThenStraightWithoutAStep) {
  const HillMuscle muscle;
  const auto& p = muscle.parameters();
  const double knee = (1.0 + p.series_toe) * p.series_rest;
  EXPECT_EQ(muscle.series_force(p.series_rest), 0.0);
  EXPECT_NEAR(muscle.series_force(knee), p.series_force, 1e-9);

  const double step = 1e-7;
  const double before = (muscle.series_force(knee) - muscle.series_force(knee - step)) / step;
  const double after = (muscle.series_force(knee + step) - muscle.series_force(knee)) / step;
  EXPECT_NEAR(before / after, 1.0, 1e-4);
  EXPECT_NEAR(after, p.series_force / (p.series_linear * p.series_rest), 1.0);
}

TEST(HillMuscle, ContractileForceFallsWithShorteningAndRisesToTheEccentricLimit) {
  const HillMuscle muscle;
  const auto& p = muscle.parameters();
  double last = 0.0;
  for (int step = -20; step <= 60; ++step) {
    const double velocity = 0.05 * step;
    const double force = muscle.contractile_force(p.optimal_length, velocity, 1.0);
    EXPECT_GT(force, last) << "at " << velocity << " m/s";
    last = force;
  }
  EXPECT_NEAR(muscle.contractile_force(p.optimal_length, 1e6, 1.0),
              p.eccentric_force * p.maximum_force, 1e-2);
}

TEST(HillMuscle, RestsWhereItsElementsAreInBalance) {
  const HillMuscle muscle;
  for (double length : {0.60, 0.62, 0.64, 0.66, 0.68, 0.70, 0.72, 0.74, 0.76}) {
    for (double activation : {0.0, 0.1, 0.4, 1.0}) {
      const double fibre = muscle.resting_fibre_length(length, activation);
      const double balance = muscle.series_force(length - fibre) - muscle.parallel_force(fibre) -
                             muscle.contractile_force(fibre, 0.0, activation);
      EXPECT_NEAR(balance, 0.0, 1e-8) << length << " m, activation " << activation;

      const Pull pull = muscle.pull(length, 0.0, fibre, activation);
      EXPECT_NEAR(pull.fibre_velocity, 0.0, 1e-9);
      EXPECT_NEAR(pull.force, muscle.resting_force(length, activation), 1e-8);
    }
  }
}

TEST(HillMuscle, RestingForceGrowsWithActivationAndWithLength) {
  const HillMuscle muscle;
  for (double length : {0.63, 0.65, 0.67, 0.69, 0.71, 0.73}) {
    for (double activation : {0.1, 0.2, 0.4, 0.6, 0.9}) {
      const double force = muscle.resting_force(length, activation);
      EXPECT_GT(muscle.resting_force(length, activation + 0.05), force);
      EXPECT_GT(muscle.resting_force(length + 0.005, activation), force);
    }
  }
}

TEST(HillMuscle, VelocityOfTheFibreKeepsItsElementsInBalanceInMotion) {
  const HillMuscle muscle;
  for (double stretch : {-8.0, -2.0, 0.0, 2.0, 8.0}) {
    for (double velocity : {-0.3, -0.05, 0.0, 0.05, 0.3}) {
      for (double activation : {0.05, 0.3, 1.0}) {
        const double length = 0.69;
        const double fibre = muscle.resting_fibre_length(length, activation) + stretch * kMilli;
        const double speed = muscle.pull(length, velocity, fibre, activation).fibre_velocity;
        const double inner =
            muscle.contractile_force(fibre, speed, activation) + muscle.parallel_force(fibre);
        const double outer =
            muscle.series_force(length - fibre) + muscle.damping_force(inner, velocity - speed);
        EXPECT_NEAR(outer, inner, 1e-8)
            << stretch << " mm, " << velocity << " m/s, activation " << activation;
      }
    }
  }
}

TEST(HillMuscle, ShortenedFibresStretchAndStretchedFibresShortenTowardsRest) {
  const HillMuscle muscle;
  for (double activation : {0.1, 0.5, 1.0}) {
    const double rest = muscle.resting_fibre_length(0.68, activation);
    EXPECT_GT(muscle.pull(0.68, 0.0, rest - 1e-3, activation).fibre_velocity, 0.0);
    EXPECT_LT(muscle.pull(0.68, 0.0, rest + 1e-3, activation).fibre_velocity, 0.0);
  }
}

TEST(MakeMuscle, GivesTheModelAskedFor) {
  EXPECT_TRUE(std::holds_alternative<LinearMuscle>(make_muscle(MuscleModel::linear)));
  EXPECT_TRUE(std::holds_alternative<HillMuscle>(make_muscle(MuscleModel::hill)));
}

}  // namespace
}  // namespace o80::pam
