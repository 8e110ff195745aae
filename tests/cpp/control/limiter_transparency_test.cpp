// A motion that keeps the limits is not touched by them (docs/commands.md#limits): whatever comes
// to rest within its own largest speed, acceleration and jerk, and within its own span, passes as
// it is.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "control/rig.hpp"

namespace o80::test {
namespace {

/// What a sampled motion from rest to rest needs, in seconds.
Limits limits_of(const std::vector<double>& positions, bool acceleration, bool jerk) {
  Limits found{positions[0], positions[0], 1e-9, 1e-9, 1e-9};
  const auto at = [&](std::size_t i, std::size_t back) {
    return positions[i < back ? 0 : i - back];
  };
  for (std::size_t i = 0; i < positions.size() + 3; ++i) {
    const auto place = [&](std::size_t back) {
      return i >= back && i - back >= positions.size() ? positions.back() : at(i, back);
    };
    const double p0 = place(0);
    const double p1 = place(1);
    const double p2 = place(2);
    const double p3 = place(3);
    found.minimum = std::min(found.minimum, p0);
    found.maximum = std::max(found.maximum, p0);
    found.speed = std::max(found.speed, std::abs(p0 - p1) * 1e3);
    found.acceleration = std::max(found.acceleration, std::abs(p0 - 2.0 * p1 + p2) * 1e6);
    found.jerk = std::max(found.jerk, std::abs(p0 - 3.0 * p1 + 3.0 * p2 - p3) * 1e9);
  }
  constexpr double kMargin = 1.0 + 1e-6;
  found.speed *= kMargin;
  found.acceleration *= kMargin;
  found.jerk *= kMargin;
  constexpr double kNone = std::numeric_limits<double>::infinity();
  if (!acceleration) found.acceleration = kNone;
  if (!acceleration || !jerk) found.jerk = kNone;
  if (acceleration && jerk) {
    // how a number would stop is planned in whole iterations: near a bound that costs up to what an
    // iteration can cover
    found.minimum -= found.speed * 1e-3;
    found.maximum += found.speed * 1e-3;
  }
  return found;
}

class LimiterTransparency : public testing::TestWithParam<int> {
 protected:
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }
  /// The limits of a motion: speed only, with acceleration, or with jerk as well.
  static Schema robot_for(const std::vector<double>& positions) {
    Schema robot = plain_robot(1);
    robot.actuator(0).limits(limits_of(positions, GetParam() >= 1, GetParam() >= 2));
    return robot;
  }

  std::mt19937_64 random_{3};
};

TEST_P(LimiterTransparency, MinimumJerkWithinTheLimitsIsTheSameAsWithoutThem) {
  for (int round = 0; round < 400; ++round) {
    const double target = real(-3.0, 3.0);
    const RecordHead head = smoothly(over(whole(4, 300)));
    Rig free(plain_robot(1), 16);
    free.add(0, head, {target});
    free.pulse();
    std::vector<double> positions{0.0};
    while (free.controller.active()) positions.push_back(free.run(1)[0]);

    Rig rig(robot_for(positions), 16);
    rig.add(0, head, {target});
    const CommandId batch = rig.pulse();
    for (std::size_t i = 1; i < positions.size(); ++i) {
      rig.step();
      ASSERT_EQ(rig.desired(), positions[i]) << "round " << round << ", iteration " << i;
      ASSERT_FALSE(rig.clamped());
    }
    ASSERT_EQ(rig.witness.status(batch + 2), Status::completed);
  }
}

TEST_P(LimiterTransparency, AStreamOfDirectCommandsWithinTheLimitsPasses) {
  for (int round = 0; round < 150; ++round) {
    // overwritten again and again, then at rest
    Rig free(plain_robot(1), 64);
    std::vector<double> positions{0.0};
    for (int link = whole(1, 8); link >= 0; --link) {
      free.add(0, overwriting(smoothly(over(whole(20, 200)))), {real(-1.0, 1.0)});
      free.pulse();
      for (int i = link == 0 ? 1000 : whole(1, 150); i > 0 && free.controller.active(); --i) {
        positions.push_back(free.run(1)[0]);
      }
    }
    Rig rig(robot_for(positions), 16);
    for (std::size_t i = 1; i < positions.size(); ++i) {
      rig.add(0, overwriting(direct()), {positions[i]});
      const CommandId batch = rig.pulse();
      rig.step();
      ASSERT_EQ(rig.desired(), positions[i])
          << "round " << round << ", iteration " << i << " of " << positions.size();
      ASSERT_FALSE(rig.clamped());
      ASSERT_EQ(rig.witness.status(batch + 2), Status::completed);
    }
  }
}

TEST_P(LimiterTransparency, WhatAsksForALittleMoreIsHeldBackAndSaysSo) {
  const RecordHead head = smoothly(over(100));
  Rig free(plain_robot(1), 16);
  free.add(0, head, {1.0});
  free.pulse();
  std::vector<double> positions{0.0};
  while (free.controller.active()) positions.push_back(free.run(1)[0]);

  Rig rig(robot_for(positions), 16);
  rig.add(0, smoothly(over(95)), {1.0});
  rig.pulse();
  bool clamped = false;
  for (int i = 0; i < 95; ++i) {
    rig.step();
    clamped |= rig.clamped();
  }
  EXPECT_TRUE(clamped);
}

std::string name_of_rates(const testing::TestParamInfo<int>& limited) {
  constexpr std::array kNames{"Speed", "Acceleration", "Jerk"};
  return kNames.at(static_cast<std::size_t>(limited.param));
}

INSTANTIATE_TEST_SUITE_P(Rates, LimiterTransparency, testing::Values(0, 1, 2), name_of_rates);

}  // namespace
}  // namespace o80::test
