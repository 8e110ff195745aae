#include "describe/table.hpp"

#include <gmock/gmock.h>

#include <cstring>

#include "describe/described.hpp"
#include "o80/describe/layout.hpp"

namespace o80 {
namespace {

using described::MixedRobot;
using described::schema_of;
using ::testing::HasSubstr;

TEST(Table, ASchemaSurvivesTheWayThroughItsBytes) {
  const Schema schema = schema_of<MixedRobot>();
  const Schema again = schema_from_bytes(to_bytes(schema));
  EXPECT_EQ(again, schema);
  EXPECT_EQ(hash(again), hash(schema));
  EXPECT_EQ(again.hooks.size(), schema.types.size());
}

TEST(Table, TheHashTellsSchemasApart) {
  const Schema schema = schema_of<MixedRobot>();
  Schema other = schema;
  other.limits[3].maximum = 1;
  EXPECT_NE(hash(other), hash(schema));
  other = schema;
  other.fields[0].unit = UnitText("deg");
  EXPECT_NE(hash(other), hash(schema));
}

/// A robot whose first joint and force sensor move a model.
Schema shown_robot() {
  Schema schema = schema_of<MixedRobot>();
  schema.shown.mjcf = "<mujoco/>";
  schema.shown.file = "/models/arm.xml";
  schema.actuator(0).moves_joint("elbow");
  schema.sensor_moves_joint("force", 2, "slide");
  schema.shown.position("ball", 0, ShownFrom::extended);
  return schema;
}

TEST(Table, AModelSurvivesTheWayThroughItsBytes) {
  const Schema schema = shown_robot();
  EXPECT_EQ(schema.shown.values[1].offset, 2 * sizeof(double));
  const Schema again = schema_from_bytes(to_bytes(schema));
  EXPECT_EQ(again, schema);
  EXPECT_EQ(again.shown.file, "/models/arm.xml");
  EXPECT_EQ(again.shown.values.size(), 3u);
}

TEST(Table, ADescriptionWithoutAModelHasTheBytesOfEarlierVersions) {
  const std::vector<std::byte> shown = to_bytes(shown_robot());
  const std::vector<std::byte> plain = to_bytes(schema_of<MixedRobot>());
  ASSERT_LT(plain.size(), shown.size());
  EXPECT_EQ(std::memcmp(plain.data(), shown.data(), plain.size()), 0);
  EXPECT_EQ(schema_from_bytes(std::span(shown).first(plain.size())), schema_of<MixedRobot>());
}

TEST(Table, RefusesADamagedModel) {
  const std::vector<std::byte> good = to_bytes(shown_robot());
  std::vector<std::byte> cut(good.begin(), good.end() - 1);
  EXPECT_THAT(message_of<SegmentError>([&] { schema_from_bytes(cut); }), HasSubstr("cut off"));
}

/// What `check` says of a change to the robot with a model.
template <class Change>
std::string model_refusal(Change&& change) {
  Schema schema = shown_robot();
  change(schema);
  return message_of<InvalidArgument>([&] { check(schema); });
}

TEST(Table, RefusesAModelThatCannotBeShown) {
  check(shown_robot());
  EXPECT_THAT(model_refusal([](Schema& s) { s.shown.values[0].offset = s.head.block - 7; }),
              HasSubstr("'elbow' in the model lies outside the row"));
  EXPECT_THAT(model_refusal([](Schema& s) { s.shown.values[2].offset = 0xFFFFFFFF; }),
              HasSubstr("'ball' in the model lies outside the row"));
  EXPECT_THAT(model_refusal([](Schema& s) { s.shown.mjcf = "\xff"; }), HasSubstr("UTF-8"));
  EXPECT_THAT(model_refusal([](Schema& s) { s.shown.mjcf.resize(ShownModel::kLargest + 1); }),
              HasSubstr("too large"));
  EXPECT_THAT(
      message_of<InvalidArgument>([] { shown_robot().sensor_moves_joint("forces", 0, "a"); }),
      HasSubstr("Did you mean 'force'"));
  EXPECT_THAT(
      message_of<InvalidArgument>([] { shown_robot().sensor_moves_joint("count", 0, "a"); }),
      HasSubstr("has no double"));
  EXPECT_THAT(message_of<InvalidArgument>([] { shown_robot().actuator("mode").moves_joint("a"); }),
              HasSubstr("does not begin with a double"));
}

TEST(Table, KeepsBoundsOfAnIntegral) {
  for (const bool shows : {false, true}) {
    Schema schema = shows ? shown_robot() : schema_of<MixedRobot>();
    const auto type = schema.add_type(
        "Wheel", {scalar_field("angle", Kind::float64), scalar_field("speed", Kind::float64)});
    const std::uint32_t group = schema.add_actuators("wheels", type, 2);
    ActuatorDescription wheel = schema.actuator(schema.groups[group].first_actuator + 1);
    wheel.rests_at("speed", 0.0)
        .limits("speed", {.speed = 1.0, .integral = {"angle", -1.0, 2.0, 0.1}});
    const std::vector<std::byte> bytes = to_bytes(schema);
    const Schema again = schema_from_bytes(bytes);
    EXPECT_EQ(again, schema);
    ASSERT_EQ(again.integrals.size(), 1U);
    EXPECT_EQ(again.integrals[0].maximum, 2.0);
    EXPECT_THAT(message_of<SegmentError>(
                    [&] { schema_from_bytes(std::span(bytes).first(bytes.size() - 1)); }),
                HasSubstr("integral bounds"));
    wheel.limits("speed", {.speed = 1.0});
    EXPECT_TRUE(schema.integrals.empty());
  }
}

/// What `check` says after a change.
template <class Change>
std::string refusal(Change&& change) {
  Schema schema = schema_of<MixedRobot>();
  change(schema);
  return message_of<InvalidArgument>([&] { check(schema); });
}

TEST(Table, RefusesWhatCannotBeUsed) {
  check(schema_of<MixedRobot>());
  EXPECT_THAT(refusal([](Schema& s) { s.actuators[1].name = s.actuators[0].name; }),
              HasSubstr("two actuators are called 'joints_0'"));
  EXPECT_THAT(refusal([](Schema& s) { s.actuators[1].name = NameText(); }), HasSubstr("no name"));
  EXPECT_THAT(refusal([](Schema& s) { s.fields[0].offset = 9; }), HasSubstr("outside its struct"));
  EXPECT_THAT(refusal([](Schema& s) { s.limits[0] = Limits{.minimum = 2, .maximum = 1}.row(); }),
              HasSubstr("got 2.000000 to 1.000000"));
  EXPECT_THAT(refusal([](Schema& s) { s.limits[0].speed = 0; }),
              HasSubstr("speed must be positive, got 0.000000"));
  EXPECT_THAT(refusal([](Schema& s) { s.limits[0].minimum = std::nan(""); }), HasSubstr("limits"));
  EXPECT_THAT(refusal([](Schema& s) { s.limits[0].jerk = 1.0; }),
              HasSubstr("jerk without an acceleration"));
  EXPECT_THAT(refusal([](Schema& s) { s.limits[0].acceleration = 1.0; }),
              HasSubstr("acceleration without a speed"));
  EXPECT_THAT(refusal([](Schema& s) { s.types[0].name = NameText("a\x80"); }), HasSubstr("UTF-8"));
  for (const Limits& limits : {Limits{.error = std::nan("")}, Limits{.noise = std::nan("")}}) {
    EXPECT_THAT(refusal([&](Schema& s) { s.limits[0] = limits.row(); }), HasSubstr("limits of"));
  }
  EXPECT_THAT(refusal([](Schema& s) { s.limits.push_back(Limits{}.row()); }),
              HasSubstr("a limit belongs to no actuator"));
  EXPECT_THAT(refusal([](Schema& s) { s.actuators[1].first_limit = 0; }),
              HasSubstr("one limit for each number"));
  EXPECT_THAT(refusal([](Schema& s) { s.actuators[0].type = 99; }), HasSubstr("missing type"));
  EXPECT_THAT(refusal([](Schema& s) { s.actuators[8].offset = 4000; }),
              HasSubstr("outside the row"));
  EXPECT_THAT(refusal([](Schema& s) { s.requests[1].name = s.requests[0].name; }),
              HasSubstr("two requests"));
  EXPECT_THAT(refusal([](Schema& s) { s.groups[0].type = 99; }), HasSubstr("missing type"));
  EXPECT_THAT(refusal([](Schema& s) { s.head.robot.chars[0] = '\n'; }),
              HasSubstr("control character"));
}

TEST(Table, RefusesARestThatANumberCannotHave) {
  const auto refusal_of = [](Kind kind, double rest) {
    Schema schema;
    schema.head.robot = NameText("tool");
    schema.add_actuators("tool", schema.add_type("Tool", {scalar_field("x", kind)}), 1, false);
    schema.head.block = 8;
    schema.actuator(0).rests_at("x", rest);
    return message_of<InvalidArgument>([&] { check(schema); });
  };
  EXPECT_THAT(refusal_of(Kind::boolean, 0), HasSubstr("'x' of actuator 'tool' cannot rest at 0.0"));
  EXPECT_THAT(refusal_of(Kind::uint8, -1), HasSubstr("a value that the field can hold"));
  EXPECT_THAT(refusal_of(Kind::uint8, 256), HasSubstr("cannot rest"));
  EXPECT_THAT(refusal_of(Kind::int32, 0.5), HasSubstr("cannot rest"));
  EXPECT_THAT(refusal_of(Kind::float32, 1e39), HasSubstr("cannot rest"));
  EXPECT_EQ(refusal_of(Kind::uint8, 255), "");
  EXPECT_EQ(refusal_of(Kind::int8, -128), "");
  EXPECT_EQ(refusal_of(Kind::float32, 0.1), "");
}

TEST(Table, RefusesArraysWhoseSizeOverflows) {
  EXPECT_THAT(refusal([](Schema& s) {
                s.fields[0].rows = 1U << 31;
                s.fields[0].columns = 1U << 31;
              }),
              HasSubstr("too many elements"));
}

TEST(Table, RefusesMoreActuatorsThanARecordCanName) {
  Schema schema;
  const auto type = schema.add_type("float64", {scalar_field("", Kind::float64)});
  schema.add_actuators("cell", type, 65534);
  check(schema);
  schema.add_actuators("more", type, 1);
  EXPECT_THAT(message_of<InvalidArgument>([&] { check(schema); }), HasSubstr("too many actuators"));
}

TEST(Table, RefusesTypesThatNestTooDeep) {
  Schema schema;
  auto type = schema.add_type("T0", {scalar_field("x", Kind::float64)});
  const auto nest = [&] {
    FieldRow field;
    field.name = NameText("inner");
    field.kind = Kind::structure;
    field.type = type;
    type = schema.add_type("T", {field});
  };
  for (int i = 0; i < 16; ++i) nest();
  check(schema);
  nest();
  EXPECT_THAT(message_of<InvalidArgument>([&] { check(schema); }), HasSubstr("nested too deeply"));
}

TEST(Table, RefusesForeignAndTruncatedBytes) {
  std::vector<std::byte> bytes = to_bytes(schema_of<MixedRobot>());
  const auto read = [](std::span<const std::byte> some) {
    return message_of<SegmentError>([&] { schema_from_bytes(some); });
  };
  EXPECT_THAT(read({}), HasSubstr("too short"));
  for (std::size_t size = 0; size < bytes.size(); size += 7) {
    EXPECT_NE(read(std::span(bytes).first(size)), "") << size;
  }
  bytes[0] = std::byte{0};
  EXPECT_THAT(read(bytes), HasSubstr("no schema"));
}

TEST(Table, TheOriginOfAFieldIsKeptAndAnUnknownOneIsRefused) {
  Schema schema;
  schema.head.extended = describing::type_of<described::Origins>(schema);
  const TypeRow& type = schema.types[schema.head.extended];
  const auto origin = [&](std::uint32_t field) -> Origin& {
    return schema.fields[type.first_field + field].origin;
  };
  EXPECT_EQ(origin(0), Origin::robot);
  EXPECT_EQ(origin(1), Origin::clock);
  EXPECT_EQ(origin(2), Origin::world);
  EXPECT_EQ(schema_from_bytes(to_bytes(schema)), schema);

  origin(0) = static_cast<Origin>(4);
  EXPECT_THROW(schema_from_bytes(to_bytes(schema)), Error);
}

}  // namespace
}  // namespace o80
