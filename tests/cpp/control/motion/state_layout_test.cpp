#include "control/motion/state_layout.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "dice.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/describe.hpp"

namespace o80::test {
namespace {

struct One {
  double position = 0;
};
struct Two {
  double position = 0, velocity = 0;
};
struct Nine {
  std::array<double, 3> position{}, velocity{}, spin{};
};
struct Mixed {
  float torque = 0;  // and a gap
  double position = 0;
  std::int8_t gear = 0;
};
O80_DESCRIBE(One, position);
O80_DESCRIBE(Two, position, velocity);
O80_DESCRIBE(Nine, position, velocity, spin);
O80_DESCRIBE(Mixed, torque, position, gear);

using Bytes = std::vector<std::byte>;

template <class T>
class StateLayoutTest : public testing::Test {
 protected:
  StateLayoutTest() : layout_(schema_, describing::type_of<T>(schema_)) {}

  Bytes bytes(int value) { return Bytes(sizeof(T), std::byte(value)); }

  /// Sets each float at random, now and then to one that is not finite.
  void draw(Bytes& state) {
    constexpr double kWrong[] = {std::numeric_limits<double>::quiet_NaN(), HUGE_VAL, -HUGE_VAL};
    for (const NumberPlace& place : layout_.numbers()) {
      const double value = dice_.one_in(4) ? kWrong[dice_.whole(0, 2)] : dice_.real(-1e3, 1e3);
      std::byte* at = state.data() + place.offset;
      if (place.kind == Kind::float64) std::memcpy(at, &value, sizeof value);
      const auto narrow = static_cast<float>(value);
      if (place.kind == Kind::float32) std::memcpy(at, &narrow, sizeof narrow);
    }
  }
  bool finite(const NumberPlace& place, const Bytes& state) {
    const std::byte* at = state.data() + place.offset;
    if (place.kind == Kind::float64) return std::isfinite(load<double>(at));
    return place.kind != Kind::float32 || std::isfinite(load<float>(at));
  }

  Schema schema_;
  StateLayout layout_;
  test::Dice dice_{1};
};

using States = testing::Types<One, Two, Nine, Mixed>;
TYPED_TEST_SUITE(StateLayoutTest, States);

TYPED_TEST(StateLayoutTest, CopiesNumbersAndNoPadding) {
  Bytes to = this->bytes(1);
  Bytes expected = to;
  const Bytes from = this->bytes(2);
  for (const NumberPlace& place : this->layout_.numbers()) {
    std::copy_n(from.begin() + place.offset, place.size, expected.begin() + place.offset);
  }
  this->layout_.copy(to.data(), from.data());
  EXPECT_EQ(to, expected);
}

TYPED_TEST(StateLayoutTest, CopiesFiniteNumbersOnly) {
  int left_out = 0;
  for (int n = 0; n < 300; ++n) {
    Bytes to = this->bytes(1), from = this->bytes(2);
    this->draw(from);
    Bytes expected = to;
    for (std::size_t i = 0; i < this->layout_.numbers().size(); ++i) {
      const NumberPlace& place = this->layout_.numbers()[i];
      const bool finite = this->finite(place, from);
      left_out += finite ? 0 : 1;
      if (!finite) continue;
      std::copy_n(from.begin() + place.offset, place.size, expected.begin() + place.offset);
    }
    this->layout_.copy_finite(to.data(), from.data());
    EXPECT_EQ(to, expected);
  }
  EXPECT_GT(left_out, 30);
}

// ------------------------------------------------------------------------------ of a schema

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
