#include "o80/runtime/robot_types.hpp"

#include <gmock/gmock.h>

namespace o80::test {
namespace {

struct ThrowBall {
  static constexpr std::string_view kHelp = "shoot the next ball";
  double speed = 0;
};
O80_DESCRIBE(ThrowBall, (speed, "[m/s]"));

struct GoHome {};
O80_DESCRIBE(GoHome);

struct Launcher {
  using Actuators = NoActuators;
  using Requests = o80::Requests<ThrowBall, GoHome>;
};

TEST(RobotTypesTest, TellTheHelpOfARequestThatHasOne) {
  Schema schema;
  describe_types<Launcher>(schema);

  ASSERT_EQ(schema.requests.size(), 2U);
  EXPECT_EQ(schema.requests[0].help.view(), "shoot the next ball");
  EXPECT_EQ(schema.requests[1].help.view(), "");
}

}  // namespace
}  // namespace o80::test
