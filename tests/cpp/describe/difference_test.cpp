#include <gmock/gmock.h>

#include <algorithm>
#include <string>

#include "describe/described.hpp"
#include "describe/table.hpp"

namespace o80 {
namespace {

using described::MixedRobot;
using described::schema_of;
using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST(Difference, OfTheSameIsNothing) {
  EXPECT_EQ(difference(schema_of<MixedRobot>(), schema_of<MixedRobot>()), "");
  EXPECT_EQ(layout_difference(schema_of<MixedRobot>(), schema_of<MixedRobot>()), "");
}

TEST(Difference, OfAWatchdogOrAModelMakesNoOtherRobot) {
  const Schema schema = schema_of<MixedRobot>();
  Schema other = schema;
  other.head.silence = 100;
  other.head.stale = Stale::halt;
  other.shown.file = "/models/arm.xml";
  EXPECT_EQ(difference(schema, other), "");
}

TEST(Difference, SaysWhatDiffersInWords) {
  const Schema expected = schema_of<MixedRobot>();
  Schema found = expected;
  found.head.period = 2'000'000;
  found.actuators[7].name = NameText("hand");
  found.limits[0].maximum = 3;
  const std::string text = difference(expected, found);
  EXPECT_THAT(text, HasSubstr("period: expected 1000000 ns, found 2000000 ns"));
  EXPECT_THAT(text, HasSubstr("actuator 7 name: expected gripper, found hand"));
  EXPECT_THAT(text, HasSubstr("actuator 0 limits: expected -inf to inf"));
  EXPECT_EQ(layout_difference(expected, found), "") << "compiled code does not rely on those";
}

TEST(Difference, OfALayoutSaysWhichFieldLiesWhere) {
  const Schema expected = schema_of<MixedRobot>();
  Schema found = expected;
  for (FieldRow& field : found.fields) {
    if (field.name.view() == "velocity") field.name = NameText("speed");
    if (field.name.view() == "force") field.rows = 2;
  }
  const std::string text = layout_difference(expected, found);
  EXPECT_THAT(text, HasSubstr("actuator 0 field 'velocity': expected float64 at byte 8, found "
                              "nothing"));
  EXPECT_THAT(text, HasSubstr("actuator 0 field 'speed': expected nothing"));
  EXPECT_THAT(text, HasSubstr("extended field 'force': expected float64[3] at byte 0, found "
                              "float64[2] at byte 0"));
}

TEST(Difference, OfALayoutForgivesAMissingUnitButNotAnother) {
  const Schema expected = schema_of<MixedRobot>();
  Schema found = expected;
  for (FieldRow& field : found.fields) field.unit = {};
  EXPECT_EQ(layout_difference(expected, found), "");
  EXPECT_EQ(layout_difference(found, expected), "");
  EXPECT_NE(difference(expected, found), "");

  for (FieldRow& field : found.fields) {
    if (field.name.view() == "position") field.unit = UnitText("deg");
  }
  EXPECT_THAT(layout_difference(expected, found),
              HasSubstr("actuator 0 field 'position' unit: expected [rad], found [deg]"));
}

TEST(Difference, OfALayoutForgivesRequestsThatAProgramDoesNotKnow) {
  const Schema with = schema_of<MixedRobot>();
  Schema without = with;
  without.requests.pop_back();
  EXPECT_EQ(layout_difference(without, with), "");
  EXPECT_THAT(layout_difference(with, without),
              AllOf(HasSubstr("request 'launch_ball'"), HasSubstr("found nothing"),
                    Not(HasSubstr("home"))));
}

TEST(Difference, OfALayoutSeesTheValuesOfAnEnumeration) {
  const Schema expected = schema_of<MixedRobot>();
  Schema found = expected;
  for (LabelRow& label : found.labels) {
    if (label.name.view() == "torque") label.value = 9;
  }
  EXPECT_THAT(layout_difference(expected, found), HasSubstr("torque = 9"));
}

TEST(Difference, ShowsFiveOfManyThoseFirstThatSayMost) {
  const Schema expected = schema_of<MixedRobot>();
  Schema found = expected;
  found.head.robot = NameText("other");
  for (ActuatorRow& actuator : found.actuators) actuator.name = NameText("a");
  for (FieldRow& field : found.fields) field.unit = UnitText("deg");

  const std::string text = difference(expected, found);

  EXPECT_THAT(text, StartsWith("  robot: expected"));
  EXPECT_EQ(std::ranges::count(text, '\n'), 6);
  EXPECT_THAT(text, ContainsRegex("\n  and [0-9]+ more differences\n$"));
}

TEST(Difference, OfHelpsAloneIsSaidToo) {
  const Schema expected = schema_of<MixedRobot>();
  Schema found = expected;
  found.requests[0].help = HelpText("goes home");
  EXPECT_THAT(difference(expected, found), HasSubstr("help texts"));
}

}  // namespace
}  // namespace o80
