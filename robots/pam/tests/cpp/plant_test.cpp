#include "pam/plant.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <random>
#include <stdexcept>

#include "count_allocations.hpp"
#include "pam/equilibrium.hpp"
#include "pam/presets.hpp"

namespace o80::pam {
namespace {

using testing::DoubleNear;
using testing::Each;
using testing::HasSubstr;
using testing::Pointwise;
using testing::ThrowsMessage;

constexpr int kSecond = 500;  // iterations

void advance(Plant& plant, const Pressures& pressures, int iterations,
             const Joints& external = {}) {
  for (int i = 0; i < iterations; ++i) plant.advance(pressures, external);
}

Pressures varied(const Plant& plant, std::mt19937& random) {
  Pressures pressures{};
  for (std::size_t m = 0; m < kMuscles; ++m) {
    const PressureRange& range = plant.config().ranges[m];
    pressures[m] =
        std::uniform_int_distribution<std::int32_t>(range.minimum, range.maximum)(random);
  }
  return pressures;
}

template <std::size_t n>
bool same_bits(const std::array<double, n>& a, const std::array<double, n>& b) {
  return std::ranges::equal(a, b, {}, std::bit_cast<std::uint64_t, double>,
                            std::bit_cast<std::uint64_t, double>);
}

bool same_bits(const Plant& a, const Plant& b) {
  const Plant::State &first = a.state(), &second = b.state();
  return first.iteration == second.iteration && first.clipped == second.clipped &&
         first.commanded == second.commanded && same_bits(first.motion.q, second.motion.q) &&
         same_bits(first.motion.dq, second.motion.dq) &&
         same_bits(first.activation, second.activation) &&
         same_bits(first.fibre_length, second.fibre_length) && first.requested == second.requested;
}

class PlantWithAnyMuscle : public testing::TestWithParam<MuscleModel> {
 protected:
  Plant::Config config() const { return {.muscle = GetParam()}; }
};

INSTANTIATE_TEST_SUITE_P(Models, PlantWithAnyMuscle,
                         testing::Values(MuscleModel::linear, MuscleModel::hill),
                         [](const auto& model) {
                           return model.param == MuscleModel::linear ? "Linear" : "Hill";
                         });

TEST_P(PlantWithAnyMuscle, StartsInAPostureLikeThatOfTheRealArmInPlay) {
  const Plant plant(config());
  EXPECT_THAT(plant.q(), Pointwise(DoubleNear(1e-3), kPlayingPosture));
  EXPECT_THAT(plant.dq(), Each(0.0));
  EXPECT_EQ(plant.pressures(), plant.start_pressures());
}

TEST_P(PlantWithAnyMuscle, HoldsStillInItsStartPosture) {
  Plant plant(config());
  const Joints start = plant.q();
  advance(plant, plant.start_pressures(), 20 * kSecond);
  EXPECT_THAT(plant.q(), Pointwise(DoubleNear(1e-9), start));
  EXPECT_THAT(plant.dq(), Each(DoubleNear(0.0, 1e-9)));
}

TEST_P(PlantWithAnyMuscle, PointsUpWithEqualPressures) {
  Plant plant(config());
  advance(plant, equal_pressures(18000), 20 * kSecond);
  EXPECT_THAT(plant.q(), Each(DoubleNear(0.0, 1e-4)));
}

TEST_P(PlantWithAnyMuscle, MovesEachJointTowardsTheMuscleWithMorePressure) {
  for (std::size_t joint = 0; joint < kJoints; ++joint) {
    for (double side : {-1.0, 1.0}) {
      Plant plant(config());
      const double start = plant.q()[joint];
      Pressures pressures = plant.start_pressures();
      pressures[agonist(joint)] += static_cast<std::int32_t>(side * 2000);
      pressures[antagonist(joint)] -= static_cast<std::int32_t>(side * 2000);
      advance(plant, pressures, 2 * kSecond);
      EXPECT_GT(side * (plant.q()[joint] - start), 0.1) << "joint " << joint + 1;
    }
  }
}

TEST_P(PlantWithAnyMuscle, SweepsTheFirstJointFastAndFar) {
  for (double side : {-1.0, 1.0}) {
    Plant plant(config());
    Pressures pressures = plant.start_pressures();
    pressures[0] = side > 0 ? 22000 : 8000;
    pressures[1] = side > 0 ? 8000 : 22000;
    double fastest = 0.0, farthest = 0.0;
    for (int i = 0; i < kSecond; ++i) {
      plant.advance(pressures);
      fastest = std::max(fastest, side * plant.dq()[0]);
      farthest = std::max(farthest, side * (plant.q()[0] - kPlayingPosture[0]));
    }
    EXPECT_GT(farthest, 0.6);
    EXPECT_GT(fastest, 3.0);
    EXPECT_LT(fastest, 12.0);
  }
}

TEST_P(PlantWithAnyMuscle, IsStifferWithBothMusclesUnderPressure) {
  double last = 1.0;
  for (std::int32_t pressure : {11000, 15000, 19000, 23000}) {
    Plant plant(config());
    Pressures pressures = plant.start_pressures();
    pressures[0] = pressures[1] = pressure;
    advance(plant, pressures, 6 * kSecond);
    const double rest = plant.q()[0];
    advance(plant, pressures, 6 * kSecond, {1.0, 0.0, 0.0, 0.0});
    const double deflection = plant.q()[0] - rest;
    EXPECT_GT(deflection, 0.001);
    EXPECT_LT(deflection, 0.95 * last) << "at " << pressure;
    last = deflection;
  }
}

TEST_P(PlantWithAnyMuscle, PressureFollowsItsCommandWithThePublishedLags) {
  Plant plant(config());
  advance(plant, equal_pressures(10000), 3 * kSecond);
  const double step = 5000.0;
  const auto share = [&](std::size_t muscle) {
    return (plant.pressures()[muscle] - 10000.0) / step;
  };
  advance(plant, equal_pressures(15000), 8);  // 16 ms
  for (std::size_t m : {0, 1}) EXPECT_NEAR(share(m), 1.0 - std::exp(-1.0), 1e-3);
  advance(plant, equal_pressures(15000), 14);  // 44 ms
  for (std::size_t m = 2; m < kMuscles; ++m) EXPECT_NEAR(share(m), 1.0 - std::exp(-1.0), 1e-3);
}

TEST_P(PlantWithAnyMuscle, RepeatsItselfBitForBit) {
  Plant first(config()), second(config());
  std::mt19937 random(7);
  for (int i = 0; i < 100; ++i) {
    const Pressures pressures = varied(first, random);
    advance(first, pressures, 20);
    advance(second, pressures, 20);
    ASSERT_TRUE(same_bits(first, second)) << "block " << i;
  }
}

TEST_P(PlantWithAnyMuscle, RunsOnFromACopiedStateBitForBit) {
  Plant original(config());
  std::mt19937 random(11);
  advance(original, varied(original, random), 133);
  const Plant::State snapshot = original.state();
  std::array<Pressures, 30> script{};
  for (Pressures& pressures : script) pressures = varied(original, random);
  for (const Pressures& pressures : script) advance(original, pressures, 10);

  Plant other(config());
  advance(other, equal_pressures(9000), 50);
  other.restore(snapshot);
  for (const Pressures& pressures : script) advance(other, pressures, 10);
  EXPECT_TRUE(same_bits(original, other));
}

TEST_P(PlantWithAnyMuscle, ResetForgetsEverything) {
  Plant fresh(config()), used(config());
  advance(used, equal_pressures(30000), 300);
  used.reset(5);
  EXPECT_TRUE(same_bits(fresh, used));
}

TEST_P(PlantWithAnyMuscle, StaysWithinItsMeansUnderWildPressures) {
  Plant plant(config());
  std::mt19937 random(3);
  const double start = plant.arm().energy(plant.state().motion);
  for (int i = 0; i < 1000; ++i) {
    const Pressures pressures = varied(plant, random);
    for (int k = 0; k < 15; ++k) {
      plant.advance(pressures);
      for (double angle : plant.q()) ASSERT_LE(std::abs(angle), kJointLimit);
      for (double speed : plant.dq()) ASSERT_LT(std::abs(speed), 40.0);
      ASSERT_LT(plant.arm().energy(plant.state().motion) - start, 60.0);
    }
  }
}

TEST_P(PlantWithAnyMuscle, SinksAndComesToRestWithoutPressure) {
  Plant::Config upright = config();
  upright.start_posture = {0.0, 0.1, 0.1, 0.0};
  Plant plant(upright);
  ASSERT_GT(plant.racket().position[2], 2.0);
  advance(plant, equal_pressures(6000), 20 * kSecond);
  // a Hill muscle hangs in its passive elements, and creeps
  EXPECT_LT(plant.racket().position[2], 1.3);
  EXPECT_THAT(plant.dq(), Each(DoubleNear(0.0, 0.01)));
}

TEST_P(PlantWithAnyMuscle, ChangesLittleWithFinerIntegration) {
  Plant::Config fine = config();
  fine.substeps = 16;
  Plant coarse_plant(config()), fine_plant(fine);
  std::mt19937 random(19);
  for (int i = 0; i < 40; ++i) {
    const Pressures pressures = varied(coarse_plant, random);
    advance(coarse_plant, pressures, 25);
    advance(fine_plant, pressures, 25);
    EXPECT_THAT(coarse_plant.q(), Pointwise(DoubleNear(0.03), fine_plant.q()));
  }
}

TEST_P(PlantWithAnyMuscle, AllocatesNothingInMotion) {
  Plant plant(config());
  const std::size_t before = allocations;
  advance(plant, equal_pressures(17000), 100);
  plant.reset(1);
  plant.restore(plant.state());
  EXPECT_EQ(allocations, before);
}

TEST(IdentifiedPlant, AllocatesNothingInMotion) {
  Plant plant(preset(Preset::identified));
  Pressures pressures = plant.start_pressures();
  pressures[2] += 700;
  const std::size_t before = allocations;
  advance(plant, pressures, 200);
  plant.reset(1);
  plant.restore(plant.state());
  EXPECT_EQ(allocations, before);
}

TEST_P(PlantWithAnyMuscle, BringsTheRacketToWhereBallsPass) {
  const Plant start(config());
  const Equilibrium rest = start.equilibrium();
  for (const Vector& point :
       {Vector{0.50, 0.20, 1.00}, Vector{0.55, 0.20, 1.15}, Vector{0.60, 0.10, 1.10},
        Vector{0.58, 0.25, 1.20}, Vector{0.62, 0.25, 1.32}, Vector{0.68, 0.00, 1.32}}) {
    const auto posture = start.arm().posture_reaching(point, 0.3);
    ASSERT_TRUE(posture);
    Plant plant(config());
    advance(plant, rest.pressures_holding(*posture, 0.5), 6 * kSecond);
    EXPECT_THAT(plant.racket().position, Pointwise(DoubleNear(0.005), point));
  }
}

TEST_P(PlantWithAnyMuscle, SwingsTheRacketForwardAtAUsefulSpeed) {
  Plant plant(config());
  Pressures swing = plant.start_pressures();
  swing[0] = 20000, swing[1] = 10000;
  double fastest = 0.0;
  for (int i = 0; i < kSecond / 2; ++i) {
    plant.advance(swing);
    fastest = std::max(fastest, plant.racket().velocity[1]);
  }
  EXPECT_GT(fastest, 1.5);
  EXPECT_LT(fastest, 6.0);
}

TEST(Plant, ClipsPressuresOutOfRangeAndSaysWhich) {
  Plant plant, clipped;
  Pressures pressures = equal_pressures(15000);
  EXPECT_EQ(plant.advance(pressures), 0);
  EXPECT_EQ(plant.state().clipped, 0);
  clipped.restore(plant.state());

  pressures[2] = 24000, pressures[7] = 6000;
  EXPECT_EQ(plant.advance(pressures), 0);
  pressures[2] = 24001, pressures[7] = -3;
  EXPECT_EQ(clipped.advance(pressures), (1 << 2) | (1 << 7));
  EXPECT_EQ(clipped.state().clipped, 1);
  EXPECT_EQ(clipped.state().commanded[2], 24000);
  EXPECT_EQ(clipped.q(), plant.q());
}

TEST(Plant, TakesTheRangesOfTheRealArm) {
  Plant plant({.ranges = kRealRanges});
  EXPECT_THAT(plant.q(), Pointwise(DoubleNear(1e-3), kPlayingPosture));
  EXPECT_EQ(plant.advance(equal_pressures(20000)), 1 << agonist(3));  // 13000 to 19000
}

TEST(Plant, StartsAsGivenPressuresHoldIt) {
  Plant plant({.start_pressures = equal_pressures(18000)});
  EXPECT_THAT(plant.q(), Each(DoubleNear(0.0, 1e-9)));
  EXPECT_EQ(plant.start_pressures(), equal_pressures(18000));
}

TEST(Plant, StartsElsewhereWithEachSeedOnlyWhenAskedTo) {
  Plant calm, noisy({.start_noise = 0.05});
  const Joints centre = calm.q();
  calm.reset(1);
  EXPECT_EQ(calm.q(), centre);

  noisy.reset(1);
  const Joints first = noisy.q();
  EXPECT_THAT(first, Pointwise(DoubleNear(0.05), centre));
  noisy.reset(2);
  EXPECT_NE(noisy.q(), first);
  noisy.reset(1);
  EXPECT_EQ(noisy.q(), first);
}

TEST(Plant, SaysPressuresInBar) {
  const Plant plant({.start_pressures = equal_pressures(18000)});
  EXPECT_THAT(plant.bars(), Each(DoubleNear(1.8112, 1e-9)));
  EXPECT_NEAR(to_bar(15000), 1.21, 0.005);
  EXPECT_NEAR(to_bar(25000), 3.21, 0.005);
}

TEST(Plant, RefusesValuesOutOfTheirRange) {
  const auto refusal = [](const Plant::Config& config, const char* text) {
    EXPECT_THAT([&] { Plant plant(config); },
                ThrowsMessage<std::invalid_argument>(HasSubstr(text)));
  };
  refusal({.period = 0.0}, "period must be positive and finite");
  refusal({.period = std::numeric_limits<double>::infinity()},
          "period must be positive and finite");
  refusal({.substeps = 0}, "substeps must be at least 1");
  refusal({.start_pressures = equal_pressures(25000)}, "6000 to 24000");
  refusal({.start_posture = {0.0, 2.0, 0.0, 0.0}}, "within the stops");
  refusal({.start_activation = 1.5}, "0 to 1");
  Plant::Config empty;
  empty.ranges[3] = {9000, 9000};
  refusal(empty, "muscle 3");
}

TEST(Equilibrium, PressuresForAPostureHoldThatPosture) {
  for (MuscleModel model : {MuscleModel::linear, MuscleModel::hill}) {
    const Plant plant({.muscle = model});
    const Equilibrium rest = plant.equilibrium();
    for (const Joints& posture :
         {Joints{0.6, 0.9, 0.8, -0.3}, Joints{-0.6, 1.2, 0.2, 0.9}, Joints{0.0, 0.7, 1.3, 0.0}}) {
      const Pressures pressures = rest.pressures_holding(posture, 0.5);
      EXPECT_THAT(rest.posture_held_by(pressures, kPlayingPosture),
                  Pointwise(DoubleNear(1e-3), posture));
    }
  }
}

TEST(Equilibrium, TorquesBalanceGravityThere) {
  const Plant plant;
  const Equilibrium rest = plant.equilibrium();
  EXPECT_THAT(rest.muscle_torque(plant.q(), plant.start_pressures()),
              Pointwise(DoubleNear(1e-9), plant.arm().gravity(plant.q())));
}

}  // namespace
}  // namespace o80::pam
