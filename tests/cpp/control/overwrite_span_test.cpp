// What overwrites a minimum jerk continues its motion without leaving the span of the two motions
// (docs/commands.md#one-command). The numbers are those of faults that were seen.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "control/rig.hpp"

namespace o80::test {
namespace {

constexpr std::int64_t kOneSecond = 1'000'000'000;

struct Overwrite {
  double first_target;
  std::int64_t first_duration;  // [ns]
  int cut;                      // iterations of the first motion
  double second_target;
  RecordHead second;
};

/// From 0, both motions, until the second has ended.
std::vector<double> positions_of(const Overwrite& overwrite, Rig& rig) {
  std::vector<double> positions{0.0};
  rig.add(0, smoothly(during(overwrite.first_duration)), {overwrite.first_target});
  rig.pulse();
  for (const double position : rig.run(overwrite.cut)) positions.push_back(position);
  rig.add(0, overwriting(smoothly(overwrite.second)), {overwrite.second_target});
  rig.pulse();
  for (int i = 0; i < 100'000 && rig.controller.active(); ++i) {
    rig.step();
    positions.push_back(rig.desired());
  }
  return positions;
}

void expect_within_span(const Overwrite& overwrite) {
  Rig rig(plain_robot(1));
  const std::vector<double> positions = positions_of(overwrite, rig);
  const auto [lowest, highest] = std::ranges::minmax(positions);
  const auto [low, high] = std::minmax({0.0, overwrite.first_target, overwrite.second_target});
  EXPECT_GE(lowest, low);
  EXPECT_LE(highest, high);
  EXPECT_EQ(positions.back(), overwrite.second_target);
  EXPECT_EQ(rig.witness.status(rig.sent + 2), Status::completed);

  // velocity and acceleration go on where they were: their changes are small beside themselves
  double acceleration = 0.0;
  double jump = 0.0;
  const auto seam = static_cast<std::size_t>(overwrite.cut);
  for (std::size_t i = 3; i < positions.size(); ++i) {
    const double second = positions[i] - 2.0 * positions[i - 1] + positions[i - 2];
    const double former = positions[i - 1] - 2.0 * positions[i - 2] + positions[i - 3];
    acceleration = std::max(acceleration, std::abs(second));
    if (i >= seam && i <= seam + 3) jump = std::max(jump, std::abs(second - former));
  }
  EXPECT_LT(jump, 0.35 * acceleration);
}

TEST(OverwriteSpan, HoldsForALongMotionAfterTheStartOfAShortOne) {
  expect_within_span({1.0, kOneSecond / 2, 100, 2.0, during(5 * kOneSecond)});
}

TEST(OverwriteSpan, HoldsForALongMotionToAPlaceOnTheWayOfAShortOne) {
  expect_within_span({1.0, 3 * kOneSecond / 10, 100, 0.5, during(3 * kOneSecond)});
}

TEST(OverwriteSpan, HoldsForALongMotionBackAfterMostOfAShortOne) {
  expect_within_span({1.0, kOneSecond / 2, 400, 0.0, during(5 * kOneSecond)});
}

TEST(OverwriteSpan, HoldsForASpeedJustBeforeTheEndOfAnotherMotion) {
  expect_within_span({-4.0, 23 * kOneSecond / 100, 221, 4.33, at_speed(1.5)});
}

TEST(OverwriteSpan, ASpeedIsNeverExceededUnlessTheMotionTakenOverWasFaster) {
  std::mt19937_64 random(1);
  const auto real = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int round = 0; round < 1500; ++round) {
    const auto first = static_cast<std::int64_t>(real(0.05, 1.0) * kOneSecond);
    const auto cut = static_cast<int>(real(0.05, 0.98) * static_cast<double>(first) / 1e6);
    const double speed = real(0.2, 10.0);
    Rig rig(plain_robot(1));
    const std::vector<double> positions =
        positions_of({real(-5.0, 5.0), first, cut, real(-5.0, 5.0), at_speed(speed)}, rig);
    // while the last iteration before the seam speeds up, the speed at its end is above its mean
    const auto seam = static_cast<std::size_t>(cut);
    const double step = positions[seam] - positions[seam - 1];
    const double former = seam < 2 ? 0.0 : positions[seam - 1] - positions[seam - 2];
    const double taken_over = std::abs(step) + std::abs(step - former);
    const double allowed = std::max(speed * 1e-3, taken_over) * (1.0 + 1e-9);
    for (std::size_t i = seam + 1; i < positions.size(); ++i) {
      ASSERT_LE(std::abs(positions[i] - positions[i - 1]), allowed) << "round " << round;
    }
  }
}

}  // namespace
}  // namespace o80::test
