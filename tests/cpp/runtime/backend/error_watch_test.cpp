#include "runtime/backend/error_watch.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "o80/describe/describe.hpp"

namespace o80::test {
namespace {

struct Hinge {
  double position = 0;
  float torque = 0;
};
O80_DESCRIBE(Hinge, position, torque);
struct Hinges {
  using Actuators = std::array<Hinge, 2>;
};

class ErrorWatchTest : public ::testing::Test {
 protected:
  ErrorWatchTest() {
    describe_actuators<Hinges::Actuators>(schema_);
    schema_.actuator(0).name("left");
    schema_.actuator(1).name("right").limits("torque", {.error = 0.5});
  }
  std::optional<ErrorWatch::Excess> find() const {
    return ErrorWatch(schema_).find(reinterpret_cast<const std::byte*>(desired_.data()),
                                    reinterpret_cast<const std::byte*>(observed_.data()));
  }

  Schema schema_;
  Hinges::Actuators desired_{};
  Hinges::Actuators observed_{};
};

TEST_F(ErrorWatchTest, FindsTheNumberThatIsTooFarFromItsDesiredValue) {
  desired_[1].torque = 1.0F;
  observed_[1].torque = 0.5F;
  EXPECT_FALSE(find()) << "as far as allowed";
  observed_[1].torque = 0.25F;
  const auto excess = find();
  ASSERT_TRUE(excess);
  EXPECT_EQ(excess->actuator, 1U);
  EXPECT_EQ(excess->number, 1U);
  EXPECT_EQ(excess->desired, 1.0);
  EXPECT_EQ(excess->observed, 0.25);
  ShortText<248> text;
  describe_excess(schema_, *excess, text);
  EXPECT_EQ(text.view(),
            "torque of actuator 'right' is observed at 0.25, desired at 1: further apart than its "
            "error limit of 0.5");
}

TEST_F(ErrorWatchTest, WhatHasNoLimitMayBeAnywhere) {
  observed_[0].position = 1e300;
  observed_[0].torque = 1e30F;
  observed_[1].position = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(find());
}

TEST_F(ErrorWatchTest, AReadingThatIsNoNumberIsTooFar) {
  for (const float wrong :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
        -std::numeric_limits<float>::infinity()}) {
    observed_[1].torque = wrong;
    EXPECT_TRUE(find()) << wrong;
  }
}

}  // namespace
}  // namespace o80::test
