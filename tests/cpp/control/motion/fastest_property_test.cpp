// The pace `fastest` (docs/commands.md#one-command) on random limits and targets: retargeted in any
// iteration, and with several numbers. tests/processes/test_fastest.py compares its durations with
// ruckig's.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>

#include "control/rig.hpp"

namespace o80::test {
namespace {

RecordHead as_fast_as_possible() { return overwriting(paced(Pace::fastest, 0)); }

class FastestProperty : public testing::Test {
 protected:
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double magnitude(double low, double high) { return std::pow(10.0, real(low, high)); }
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(random_); }

  /// Per iteration; some have a jerk limit.
  Limits any_rates() {
    Limits rates;
    rates.speed = magnitude(-2.5, 0.0);
    rates.acceleration = rates.speed * magnitude(-1.5, 0.2);
    if (whole(0, 2) > 0) rates.jerk = rates.acceleration * magnitude(-1.2, 0.2);
    return rates;
  }
  static Limits per_second(Limits rates) {
    rates.speed *= 1e3;
    rates.acceleration *= 1e6;
    rates.jerk *= 1e9;
    return rates;
  }

  std::mt19937_64 random_{7};
};

/// The last four positions of a number, held against its rates.
class RatesOf {
 public:
  explicit RatesOf(const Limits& rates) : rates_(rates) {}

  void expect_kept(double position) {
    past_ = {past_[1], past_[2], past_[3], position};
    const double first = past_[3] - past_[2];
    const double second = first - (past_[2] - past_[1]);
    const double third = second - (past_[2] - 2.0 * past_[1] + past_[0]);
    const double slack = 1e-14 * (1.0 + std::abs(position));
    ASSERT_LE(std::abs(first), rates_.speed * (1.0 + 1e-9) + slack);
    ASSERT_LE(std::abs(second), rates_.acceleration * (1.0 + 1e-9) + slack);
    ASSERT_LE(std::abs(third), rates_.jerk * (1.0 + 1e-9) + slack);
  }

 private:
  Limits rates_;
  std::array<double, 4> past_{};
};

TEST_F(FastestProperty, ANewTargetReplacesTheFormerInAnyIteration) {
  for (int round = 0; round < 1500; ++round) {
    const Limits rates = any_rates();
    Schema robot = plain_robot(1);
    robot.actuator(0).limits(per_second(rates));
    Rig rig(robot, 64);
    RatesOf kept(rates);
    for (int part = whole(2, 12); part >= 0; --part) {
      const double target = rig.desired() + real(-1.0, 1.0) * rates.speed * magnitude(-1.0, 2.0);
      rig.add(0, as_fast_as_possible(), {target});
      const CommandId batch = rig.pulse();
      const int cut = part == 0 ? 1'000'000 : static_cast<int>(magnitude(0.0, 2.0));
      for (int i = 0; i < cut && rig.controller.active(); ++i) {
        rig.step();
        kept.expect_kept(rig.desired());
        ASSERT_FALSE(rig.clamped()) << "its own plan is within the limits, round " << round;
        ASSERT_FALSE(HasFatalFailure()) << "round " << round;
      }
      if (rig.controller.active()) continue;
      ASSERT_EQ(rig.witness.status(batch + 2), Status::completed) << round;
      ASSERT_EQ(rig.desired(), target);
      // and it is at rest
      if (part == 0) {
        for (const double position : rig.run(3)) ASSERT_EQ(position, target) << round;
        ASSERT_FALSE(rig.controller.braking());
      }
    }
  }
}

TEST_F(FastestProperty, FromRestItGoesStraightToItsTarget) {
  for (int round = 0; round < 1000; ++round) {
    const Limits rates = any_rates();
    Schema robot = plain_robot(1);
    robot.actuator(0).limits(per_second(rates));
    Rig rig(robot, 64);
    const double target = rates.speed * magnitude(-2.0, 2.5);
    rig.add(0, as_fast_as_possible(), {target});
    rig.pulse();
    for (double before = 0.0; rig.controller.active(); before = rig.desired()) {
      rig.step();
      // but for the last bits
      ASSERT_GE(rig.desired(), before - 1e-13 * target) << round;
      ASSERT_LE(rig.desired(), target * (1.0 + 1e-13)) << round;
    }
    ASSERT_EQ(rig.desired(), target);
  }
}

TEST_F(FastestProperty, SeveralNumbersEndTogetherWithTheSlowest) {
  for (int round = 0; round < 800; ++round) {
    const auto numbers = static_cast<std::uint32_t>(whole(2, 4));
    Schema robot = plain_robot(1, numbers);
    std::vector<double> target;
    std::vector<RatesOf> kept;
    Iteration slowest = 0;
    for (std::uint32_t i = 0; i < numbers; ++i) {
      const Limits rates = any_rates();
      robot.actuator(0).limits("x" + std::to_string(i), per_second(rates));
      kept.emplace_back(rates);
      target.push_back(rates.speed * magnitude(0.0, 2.0) * (whole(0, 1) == 0 ? 1.0 : -1.0));
      // how long it takes alone
      Schema single = plain_robot(1);
      single.actuator(0).limits(per_second(rates));
      Rig alone(single, 16);
      alone.add(0, as_fast_as_possible(), {target.back()});
      const CommandId batch = alone.pulse();
      while (alone.controller.active()) alone.step();
      slowest = std::max(slowest, alone.witness.last(batch + 2).iteration);
    }
    Rig rig(robot, 64);
    rig.add(0, as_fast_as_possible(), target);
    const CommandId batch = rig.pulse();
    std::vector<Iteration> arrived(numbers, 0);
    while (rig.controller.active()) {
      rig.step();
      for (std::uint32_t i = 0; i < numbers; ++i) {
        kept[i].expect_kept(rig.desired(i));
        ASSERT_FALSE(HasFatalFailure()) << "round " << round;
        const double left = std::abs(rig.desired(i) - target[i]);
        if (left > 1e-9 * std::abs(target[i])) arrived[i] = rig.next;
      }
    }
    const StatusChange end = rig.witness.last(batch + 2);
    ASSERT_EQ(end.status, Status::completed);
    ASSERT_EQ(end.iteration, slowest) << round;
    for (std::uint32_t i = 0; i < numbers; ++i) {
      ASSERT_EQ(rig.desired(i), target[i]);
      // arrived: the first iteration there, or within rounding of it
      ASSERT_GE(arrived[i], slowest - 2) << "number " << i << " waits at its target, " << round;
    }
  }
}

TEST_F(FastestProperty, ItIsRefusedForANumberWithoutLimitsOfSpeedAndAcceleration) {
  for (const Limits& limits : {Limits{}, Limits{.speed = 1.0}}) {
    Schema robot = plain_robot(1, 2);
    robot.actuator(0).limits("x0", {.speed = 1.0, .acceleration = 1.0});
    robot.actuator(0).limits("x1", limits);
    Rig rig(robot, 64);
    rig.add(0, as_fast_as_possible(), {0.1, 0.1});
    const CommandId both = rig.pulse();
    rig.step();
    EXPECT_EQ(rig.witness.status(both + 2), Status::rejected);
    // but the number that has them may be commanded alone
    rig.add_rows(0, as_fast_as_possible(), 1, {0.1, 0.0}, {}, {0b01});
    const CommandId one = rig.pulse();
    while (rig.controller.active()) rig.step();
    EXPECT_EQ(rig.witness.status(one + 2), Status::completed);
  }
}

}  // namespace
}  // namespace o80::test
