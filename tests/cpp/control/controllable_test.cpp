#include "control/state_layout.hpp"

#include <gtest/gtest.h>

#include <string>

#include "o80/base/error.hpp"
#include "o80/describe/describe.hpp"

namespace o80::test {
namespace {

struct Attitude {
  double w = 1.0, x = 0.0, y = 0.0, z = 0.0;
  static Attitude blend(const Attitude& from, const Attitude& to, double share) {
    return share < 0.5 ? from : to;
  }
};
O80_DESCRIBE(Attitude, w, x, y, z);

Schema with_wrist() {
  Schema schema;
  schema.head.robot = NameText("arm");
  schema.add_actuators("wrist", describing::type_of<Attitude>(schema), 1, false);
  return schema;
}

std::string refusal_of_layouts(const Schema& schema) {
  try {
    layouts_of_types(schema);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "";
}

TEST(LayoutsOfTypes, RefuseLimitsOfATypeThatInterpolatesByItself) {
  EXPECT_EQ(refusal_of_layouts(with_wrist()), "");
  for (const Limits& limits :
       {Limits{.minimum = -1.0}, Limits{.maximum = 1.0}, Limits{.speed = 2.0}}) {
    Schema schema = with_wrist();
    schema.actuator("wrist").limits("z", limits);

    EXPECT_EQ(refusal_of_layouts(schema),
              "actuator 'wrist' has limits, but its type 'Attitude' has its own blend(): "
              "limit it in the driver");
  }
}

TEST(LayoutsOfTypes, RefuseARestValueOfSuchAType) {
  Schema schema = with_wrist();
  schema.actuator("wrist").rests_at("w", 1.0);

  EXPECT_EQ(refusal_of_layouts(schema),
            "actuator 'wrist' has a rest value, but its type 'Attitude' has its own blend(): "
            "bring it to rest in the driver");
}

}  // namespace
}  // namespace o80::test
