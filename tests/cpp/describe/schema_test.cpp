#include "o80/describe/schema.hpp"

#include <gmock/gmock.h>

#include "describe/described.hpp"
#include "describe/table.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Schema run_time_robot() {
  Schema schema;
  schema.head.robot = NameText("model");
  const auto joint = schema.add_type(
      "Joint", {scalar_field("position", Kind::float64, "[rad]"), scalar_field("on", Kind::boolean),
                scalar_field("gains", Kind::float32, "", 2)});
  schema.add_actuators("joints", joint, 3);
  schema.add_actuators("lift", joint, 1, false);
  return schema;
}

TEST(Schema, LaysOutTypesLikeACompiler) {
  struct Joint {
    double position;
    bool on;
    float gains[2];
  };
  const Schema schema = run_time_robot();
  EXPECT_EQ(schema.types[0].size, sizeof(Joint));
  EXPECT_EQ(schema.types[0].alignment, alignof(Joint));
  EXPECT_EQ(schema.fields[1].offset, offsetof(Joint, on));
  EXPECT_EQ(schema.fields[2].offset, offsetof(Joint, gains));
}

TEST(Schema, PutsActuatorsBehindThoseThereAre) {
  const Schema schema = run_time_robot();
  ASSERT_EQ(schema.actuators.size(), 4U);
  EXPECT_EQ(schema.actuators[2].name.view(), "joints_2");
  EXPECT_EQ(schema.actuators[3].name.view(), "lift");
  EXPECT_EQ(schema.actuators[3].offset, 3 * schema.types[0].size);
  EXPECT_EQ(schema.head.block, 4 * schema.types[0].size);
  EXPECT_EQ(schema.actuators[3].limits, 4U) << "one for each number";
  check(schema);
}

TEST(Schema, AddsSensorsOneByOneAndTheirPlacesStay) {
  Schema schema = run_time_robot();
  EXPECT_EQ(schema.add_sensor(scalar_field("force", Kind::float64, "[N]")), 0U);
  EXPECT_EQ(schema.add_sensor(scalar_field("touch", Kind::boolean)), 8U);
  EXPECT_EQ(schema.add_sensor(scalar_field("image", Kind::uint16, "", 2, 3)), 10U);
  EXPECT_EQ(schema.add_sensor(scalar_field("time", Kind::float64)), 24U);
  EXPECT_EQ(schema.types[schema.head.extended].size, 32U);
  EXPECT_EQ(schema.types.size(), 2U) << "rebuilding leaves nothing behind";
  check(schema);
}

TEST(Schema, AddsSensorsOfTypesThatWereAddedInBetween) {
  Schema schema = run_time_robot();
  schema.add_sensor(scalar_field("force", Kind::float64));
  const auto contact = schema.add_type(
      "Contact", {scalar_field("depth", Kind::float64), scalar_field("body", Kind::int32)});
  FieldRow field;
  field.name = NameText("contacts");
  field.kind = Kind::structure;
  field.type = contact;
  field.rows = 4;
  EXPECT_EQ(schema.add_sensor(field), 8U);
  EXPECT_EQ(schema.types[schema.head.extended].size, 8U + 4 * 16);
  check(schema);
}

TEST(Schema, RefusesTwoSensorsOfOneNameAndStaysWhole) {
  Schema schema = run_time_robot();
  schema.add_sensor(scalar_field("force", Kind::float64));
  const Schema before = schema;
  EXPECT_THAT(
      message_of<InvalidArgument>([&] { schema.add_sensor(scalar_field("force", Kind::float32)); }),
      HasSubstr("already a sensor 'force'"));
  EXPECT_EQ(schema, before);
}

TEST(Schema, NamesActuatorsAndTheirLimits) {
  Schema schema = run_time_robot();
  schema.actuator(0).name("shoulder").limits({.maximum = 2}).when_idle(WhenIdle::follow);
  schema.actuator("lift").limits("gains", {.minimum = -1, .maximum = 1, .speed = 5});
  EXPECT_EQ(schema.actuators[0].name.view(), "shoulder");
  EXPECT_EQ(schema.actuators[0].when_idle, WhenIdle::follow);
  EXPECT_EQ(schema.limits[0].maximum, 2);
  EXPECT_EQ(schema.limits[1].maximum, Limits{}.maximum);
  const std::uint32_t lift = schema.actuators[3].first_limit;
  EXPECT_EQ(schema.limits[lift].speed, Limits{}.speed);
  EXPECT_EQ(schema.limits[lift + 2].minimum, -1);
  EXPECT_EQ(schema.limits[lift + 3].speed, 5);
}

TEST(Schema, GivesTheNumbersOfOneGroupAUnit) {
  Schema schema;
  const std::uint32_t number = describing::type_of<double>(schema);
  schema.add_actuators("joints", number, 2);
  schema.add_actuators("valves", number, 1);
  schema.actuator("joints_0").unit("rad");
  const auto unit_of = [&](std::string_view name) {
    for (const ActuatorRow& row : schema.actuators) {
      if (row.name.view() == name) return schema.fields[schema.types[row.type].first_field].unit;
    }
    return UnitText("no actuator");
  };

  EXPECT_EQ(unit_of("joints_0").view(), "rad");
  EXPECT_EQ(unit_of("joints_1").view(), "rad");
  EXPECT_EQ(unit_of("valves_0").view(), "");
  check(schema);
  EXPECT_THAT(message_of<InvalidArgument>([] { run_time_robot().actuator("lift").unit("m"); }),
              HasSubstr("'lift' is a struct"));
}

TEST(Schema, ListsWhatThereIsWhenSomethingIsNot) {
  Schema schema = run_time_robot();
  EXPECT_THAT(message_of<InvalidArgument>([&] { schema.actuator("elbow"); }),
              AllOf(HasSubstr("'elbow'"), HasSubstr("joints_0, joints_1, joints_2, lift")));
  EXPECT_THAT(message_of<InvalidArgument>([&] { schema.actuator(4); }), HasSubstr("has 4"));
  EXPECT_THAT(message_of<InvalidArgument>([&] { schema.actuator(0).limits("speed", {}); }),
              HasSubstr("position, on, gains"));
}

TEST(Schema, RefusesNamesThatAreTooLong) {
  EXPECT_THAT(message_of<InvalidArgument>([] { NameText(std::string(48, 'x')); }),
              HasSubstr("too long: at most 47"));
  EXPECT_EQ(NameText(std::string(47, 'x')).view().size(), 47U);
}

TEST(Schema, RefusesAFieldWithoutSize) {
  Schema schema;
  FieldRow mode;
  mode.name = NameText("mode");
  mode.kind = Kind::enumeration;
  EXPECT_THAT(message_of<InvalidArgument>([&] { schema.add_type("T", {mode}); }),
              HasSubstr("field 'mode' of 'T' has no size"));
}

TEST(Schema, VisitsEveryNumberInOrder) {
  const Schema schema = described::schema_of<described::MixedRobot>();
  std::uint32_t last = 0;
  std::uint32_t count = 0;
  schema.each_scalar(schema.head.extended, [&](std::uint32_t offset, const FieldRow&) {
    EXPECT_TRUE(count == 0 || offset > last);
    last = offset;
    ++count;
  });
  EXPECT_EQ(count, 3U + 8 + 2 + 2 * 3 + 1 + 1);
  EXPECT_EQ(schema.scalar_count(schema.head.extended), count);
}

TEST(SetText, SplitsUnitFromHelp) {
  FieldRow row;
  set_text(row, "of the loop [Nm/rad]");
  EXPECT_EQ(row.unit.view(), "Nm/rad");
  EXPECT_EQ(row.help.view(), "of the loop");
  FieldRow plain;
  set_text(plain, "a help");
  EXPECT_EQ(plain.unit.view(), "");
  EXPECT_EQ(plain.help.view(), "a help");
}

}  // namespace
}  // namespace o80
