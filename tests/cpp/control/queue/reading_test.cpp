// What a robot reads may be nonsense, or outside its limits: neither reaches desired
// (docs/commands/limits.md#limits).
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "control/rig.hpp"

namespace o80::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t kTenSeconds = 10'000'000'000;

void expect_finite(const Rig& rig) { ASSERT_TRUE(std::isfinite(rig.desired())); }

/// 5.0 in 10 s at no more than 1/s: it gets there in the end, and never faster than that.
void expect_that_limits_hold(Rig& rig) {
  expect_finite(rig);
  rig.add(0, during(kTenSeconds), {5.0});
  const CommandId batch = rig.pulse();
  double before = rig.desired();
  for (int i = 0; i < 10'000; ++i) {
    rig.step();
    ASSERT_LE(std::abs(rig.desired() - before), 1e-3 * (1.0 + 1e-9)) << "iteration " << i;
    before = rig.desired();
    if (i < 9'999) {
      ASSERT_TRUE(rig.active());
    }
  }
  EXPECT_EQ(rig.desired(), 5.0);
  EXPECT_EQ(rig.witness.status(batch + 2), Status::completed);
}

// rule L6
TEST(Reading, InRowZeroThatIsNoNumberIsNeverDesired) {
  for (const double odd : {kNan, kInfinity, -kInfinity}) {
    Rig rig(limited_robot({.speed = 1.0}));
    rig.observe(0, odd);
    rig.controller.restart(rig.observed.data(), nullptr, 0);
    expect_finite(rig);
    rig.step();
    expect_that_limits_hold(rig);
  }
}

TEST(Reading, OutsideTheBoundsIsLeftAtThePaceOfTheCommand) {
  Rig rig(limited_robot({.minimum = -1.0, .maximum = 1.0}));
  rig.observe(0, 1.2);
  rig.controller.restart(rig.observed.data(), nullptr, 0);
  rig.add(0, during(kTenSeconds), {0.5});
  rig.pulse();
  rig.step();
  EXPECT_DOUBLE_EQ(rig.desired(), 1.2 - 0.7 / 10'000);
  double before = rig.desired();
  for (int i = 1; i < 10'000; ++i) {
    rig.step();
    ASSERT_LE(rig.desired(), before);
    ASSERT_GT(rig.desired(), before - 1e-4);
    before = rig.desired();
  }
  EXPECT_EQ(rig.desired(), 0.5);
}

// rule L5
TEST(Reading, OutsideTheBoundsIsNeverLeftOutwards) {
  Rig rig(limited_robot({.minimum = -1.0, .maximum = 1.0}));
  rig.observe(0, 1.2);
  rig.controller.restart(rig.observed.data(), nullptr, 0);
  // a frontend would have refused it
  rig.add(0, over(10), {3.0});
  const CommandId batch = rig.pulse();
  for (const double position : rig.run(10)) ASSERT_LE(position, 1.2);
  EXPECT_EQ(rig.witness.status(batch + 2), Status::rejected) << "it can never be reached";
}

}  // namespace
}  // namespace o80::test
