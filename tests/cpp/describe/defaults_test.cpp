#include "o80/describe/defaults.hpp"

#include <gmock/gmock.h>

#include <array>
#include <limits>

#include "describe/described.hpp"
#include "describe/table.hpp"

namespace described {

struct Half {
  double given = 2.0;
  double bare;
};
O80_DESCRIBE(Half, given, bare);

struct Mixed {
  double bare;
  int integer = -4;
  Half half;
  Joint full;
  Half both{1.0, 2.0};
  std::array<double, 3> bare_array;
  std::array<std::int16_t, 3> array{1, -2, 3};
  ControlMode bare_mode;
  ControlMode mode = ControlMode::torque;
  bool flag = true;
  std::array<std::array<float, 2>, 2> matrix{};
  std::array<Joint, 2> full_array;
  std::uint64_t large = std::numeric_limits<std::uint64_t>::max();
};
O80_DESCRIBE(Mixed, bare, integer, half, full, both, bare_array, array, bare_mode, mode, flag,
             matrix, full_array, large);

struct Bare {
  double stiffness, damping;
};
O80_DESCRIBE(Bare, stiffness, damping);

struct Requested {
  using Actuators = std::array<double, 1>;
  using Requests = o80::Requests<Home, Mixed, Bare>;
};

}  // namespace described

namespace o80 {
namespace {

using described::Mixed;
using ::testing::HasSubstr;

template <class T>
constexpr auto kDefaults = describing::defaults_of<T>(std::make_index_sequence<field_count<T>()>());

TEST(Defaults, AreOfFieldsWithAnInitialiserForEachOfTheirNumbers) {
  static_assert(kDefaults<Mixed> == std::array{false, true, false, true, true, false, true, false,
                                               true, true, true, true, true});
  static_assert(kDefaults<described::Half> == std::array{true, false});
  static_assert(kDefaults<described::Joint> == std::array{true, true});
  static_assert(kDefaults<described::Bare> == std::array{false, false});
}

class DefaultsTest : public testing::Test {
 protected:
  const TypeRow& type(std::uint32_t request) const {
    return schema_.types.at(schema_.requests.at(request).type);
  }
  Schema schema_ = described::schema_of<described::Requested>();
};

TEST_F(DefaultsTest, StandInTheSchema) {
  for (std::uint32_t i = 0; i < type(1).fields; ++i)
    EXPECT_EQ(schema_.fields[type(1).first_field + i].has_default, kDefaults<Mixed>[i] ? 1 : 0)
        << i;
  ASSERT_NE(type(1).first_default, kNoType);
  const auto value = unpack<Mixed>(schema_.defaults.data() + type(1).first_default);
  EXPECT_EQ(value.integer, -4);
  EXPECT_EQ(value.both.bare, 2.0);
  EXPECT_EQ(value.array[1], -2);
  EXPECT_EQ(value.mode, described::ControlMode::torque);
  EXPECT_TRUE(value.flag);
}

TEST_F(DefaultsTest, AreNotThereForAStructWithout) {
  EXPECT_EQ(type(0).first_default, kNoType);
  EXPECT_EQ(type(2).first_default, kNoType);
}

TEST_F(DefaultsTest, AreReadFromASegment) {
  EXPECT_NO_THROW(check(schema_));
  EXPECT_TRUE(schema_from_bytes(to_bytes(schema_)) == schema_);
}

TEST_F(DefaultsTest, ThatAreNotThereAreRefused) {
  const auto why = [](const Schema& schema) {
    return message_of<InvalidArgument>([&] { check(schema); });
  };
  Schema without_bytes = schema_;
  without_bytes.defaults.clear();
  EXPECT_THAT(why(without_bytes), HasSubstr("refers to missing default values"));
  Schema without_value = schema_;
  without_value.fields[type(2).first_field].has_default = 1;
  EXPECT_THAT(why(without_value), HasSubstr("lacks the default value of 'stiffness'"));
}

TEST_F(DefaultsTest, AreNotTakenOverByATypeMadeAtRunTime) {
  const TypeRow& mixed = type(1);
  const auto first = schema_.fields.begin() + mixed.first_field;
  schema_.add_type("Other", {first, first + 2});
  EXPECT_NO_THROW(check(schema_));
}

}  // namespace
}  // namespace o80
