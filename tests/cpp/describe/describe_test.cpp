#include "o80/describe/describe.hpp"

#include <gmock/gmock.h>

#include <vector>

#include "describe/described.hpp"

namespace {

using namespace described;  // NOLINT(google-build-using-namespace)
using ::testing::Each;
using ::testing::ElementsAre;

const o80::FieldRow& field(const o80::Schema& schema, std::uint32_t type, std::uint32_t index) {
  return schema.fields.at(schema.types.at(type).first_field + index);
}

std::uint32_t type_named(const o80::Schema& schema, std::string_view name) {
  for (std::uint32_t i = 0; i < schema.types.size(); ++i) {
    if (schema.types[i].name.view() == name) return i;
  }
  ADD_FAILURE() << "no type " << name;
  return 0;
}

TEST(Describe, CountsTheFieldsOfAStruct) {
  static_assert(o80::field_count<Joint>() == 2);
  static_assert(o80::field_count<Sensors>() == 6);
  static_assert(o80::field_count<Config>() == 7);
  static_assert(o80::field_count<Home>() == 0);
}

TEST(Describe, GivesNamesUnitsHelpsAndPlaces) {
  const o80::Schema schema = schema_of<MixedRobot>();
  const std::uint32_t joint = type_named(schema, "Joint");
  EXPECT_EQ(schema.types[joint].size, sizeof(Joint));
  EXPECT_EQ(field(schema, joint, 0).name.view(), "position");
  EXPECT_EQ(field(schema, joint, 0).unit.view(), "rad");
  EXPECT_EQ(field(schema, joint, 0).help.view(), "");
  EXPECT_EQ(field(schema, joint, 1).offset, offsetof(Joint, velocity));
  EXPECT_EQ(field(schema, joint, 1).unit.view(), "rad/s");
  EXPECT_EQ(field(schema, joint, 1).help.view(), "how fast");
}

TEST(Describe, TakesArraysAndNestedStructsApart) {
  const o80::Schema schema = schema_of<MixedRobot>();
  const std::uint32_t sensors = schema.head.extended;
  const o80::FieldRow& force = field(schema, sensors, 0);
  EXPECT_EQ(force.rows, 3U);
  EXPECT_EQ(force.columns, 0U);
  EXPECT_EQ(force.kind, o80::Kind::float64);
  const o80::FieldRow& matrix = field(schema, sensors, 1);
  EXPECT_EQ(matrix.rows, 4U);
  EXPECT_EQ(matrix.columns, 2U);
  EXPECT_EQ(matrix.kind, o80::Kind::float32);
  EXPECT_EQ(matrix.size, 4U);
  const o80::FieldRow& nested = field(schema, sensors, 2);
  EXPECT_EQ(nested.kind, o80::Kind::structure);
  EXPECT_EQ(schema.types.at(nested.type).name.view(), "Joint");
  const o80::FieldRow& padded = field(schema, sensors, 3);
  EXPECT_EQ(padded.rows, 2U);
  EXPECT_EQ(padded.size, sizeof(Padded));
}

TEST(Describe, NamesTheValuesOfAnEnumeration) {
  const o80::Schema schema = schema_of<MixedRobot>();
  const o80::FieldRow& mode = field(schema, schema.head.extended, 4);
  EXPECT_EQ(mode.kind, o80::Kind::enumeration);
  EXPECT_EQ(mode.size, 1U);
  EXPECT_EQ(mode.is_signed, 0);
  ASSERT_EQ(mode.labels, 3U);
  EXPECT_EQ(schema.labels.at(mode.first_label + 1).name.view(), "position");
  EXPECT_EQ(schema.labels.at(mode.first_label + 1).value, 3);
  EXPECT_EQ(schema.labels.at(mode.first_label + 2).value, 4);
}

TEST(Describe, DescribesATypeOnce) {
  const o80::Schema schema = schema_of<MixedRobot>();
  int joints = 0;
  for (const o80::TypeRow& type : schema.types) joints += type.name.view() == "Joint" ? 1 : 0;
  EXPECT_EQ(joints, 1);
}

TEST(Describe, MakesEachFieldAnActuatorAndAnArrayFieldMany) {
  const o80::Schema schema = schema_of<MixedRobot>();
  ASSERT_EQ(schema.actuators.size(), 9U);
  EXPECT_EQ(schema.actuators[0].name.view(), "joints_0");
  EXPECT_EQ(schema.actuators[6].offset, 6 * sizeof(Joint));
  EXPECT_EQ(schema.actuators[7].name.view(), "gripper");
  EXPECT_EQ(schema.actuators[7].offset, offsetof(Actuators, gripper));
  EXPECT_EQ(schema.actuators[8].name.view(), "mode");
  ASSERT_EQ(schema.groups.size(), 3U);
  EXPECT_EQ(schema.groups[0].count, 7U);
  EXPECT_EQ(schema.groups[1].is_array, 0U);
}

/// Actuators that are plain numbers, two of them of one type.
struct PlainActuators {
  std::array<double, 2> joints{};
  double grip = 0;
  double spare = 0;
};
O80_DESCRIBE(PlainActuators, (joints, "[rad]"), (grip, "how hard [N]", o80::rests_at(2)), spare);
struct PlainRobot {
  using Actuators = PlainActuators;
};

TEST(Describe, GivesPlainNumbersTheNotesOfTheirGroup) {
  const o80::Schema schema = schema_of<PlainRobot>();
  const auto number = [&](std::size_t group) {
    return field(schema, schema.groups[group].type, 0);
  };
  EXPECT_EQ(number(0).unit.view(), "rad");
  EXPECT_EQ(number(1).unit.view(), "N");
  EXPECT_EQ(number(1).help.view(), "how hard");
  EXPECT_EQ(number(2).unit.view(), "");
  EXPECT_EQ(schema.groups[0].count, 2U);
  EXPECT_EQ(schema.limits[schema.actuators[2].first_limit].rest, 2.0);
  EXPECT_EQ(schema.limits[schema.actuators[3].first_limit].resting, 0U);
}

TEST(Describe, KnowsEveryKindOfNumber) {
  using o80::Kind;
  using o80::describing::kind_of;
  static_assert(kind_of<bool>() == Kind::boolean);
  static_assert(kind_of<std::int8_t>() == Kind::int8 && kind_of<std::uint8_t>() == Kind::uint8);
  static_assert(kind_of<std::int16_t>() == Kind::int16);
  static_assert(kind_of<int>() == Kind::int32 && kind_of<unsigned>() == Kind::uint32);
  static_assert(kind_of<long>() == Kind::int64 && kind_of<long long>() == Kind::int64);
  static_assert(kind_of<std::size_t>() == Kind::uint64);
  static_assert(kind_of<float>() == Kind::float32 && kind_of<double>() == Kind::float64);
}

TEST(Describe, NamesRequestsInSnakeCase) {
  EXPECT_EQ(o80::request_name<Home>(), "home");
  EXPECT_EQ(o80::request_name<LaunchBall>(), "launch_ball");
}

TEST(Pack, LeavesThePaddingOfNestedArraysAlone) {
  Sensors value;
  std::memset(static_cast<void*>(&value), 0xAB, sizeof value);
  value.force = {};
  value.matrix = {};
  value.nested = {};
  for (Padded& each : value.padded) each.small = 0, each.large = 0, each.middle = 0;
  value.mode = ControlMode::off;
  value.count = 0;
  std::vector<std::byte> bytes(sizeof(Sensors));
  o80::pack(value, bytes.data());
  EXPECT_THAT(bytes, Each(std::byte{0}));
}

TEST(Pack, GivesBackWhatItGot) {
  Sensors value;
  value.force = {1, 2, 3};
  value.matrix[3][1] = 4;
  value.padded[1] = {.small = 5, .large = 6, .middle = -7};
  value.mode = ControlMode::torque;
  value.count = -8;
  std::vector<std::byte> bytes(sizeof(Sensors));
  o80::pack(value, bytes.data());
  const auto again = o80::unpack<Sensors>(bytes.data());
  EXPECT_THAT(again.force, ElementsAre(1, 2, 3));
  EXPECT_EQ(again.matrix[3][1], 4);
  EXPECT_EQ(again.padded[1].small, 5);
  EXPECT_EQ(again.padded[1].large, 6);
  EXPECT_EQ(again.padded[1].middle, -7);
  EXPECT_EQ(again.mode, ControlMode::torque);
  EXPECT_EQ(again.count, -8);
}

TEST(Pack, OfNothingTouchesNothing) {
  o80::pack(o80::NoActuators{}, nullptr);
  static_cast<void>(o80::unpack<o80::NoActuators>(nullptr));
}

}  // namespace
