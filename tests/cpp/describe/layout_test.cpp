#include "o80/describe/layout.hpp"

#include <gtest/gtest.h>

#include "describe/described.hpp"

namespace o80 {
namespace {

TEST(RowLayout, PutsThePartsOneBehindTheOther) {
  const Schema schema = described::schema_of<described::MixedRobot>();
  const RowLayout layout = row_layout(schema);
  EXPECT_EQ(layout.desired, sizeof(RowHead));
  EXPECT_EQ(layout.block, round_up(sizeof(described::Actuators), 8));
  EXPECT_EQ(layout.observed, layout.desired + layout.block);
  EXPECT_EQ(layout.extended, layout.observed + layout.block);
  EXPECT_EQ(layout.active, layout.extended + round_up(sizeof(described::Sensors), 8));
  EXPECT_EQ(layout.mask_words, 1U);
  EXPECT_EQ(layout.starved, layout.braking + 8);
  EXPECT_EQ(layout.off_plan, layout.starved + 8);
  EXPECT_EQ(layout.size, layout.off_plan + round_up(schema.actuators.size() * 4, 8));
  EXPECT_EQ(layout.size % 8, 0U);
}

TEST(RowLayout, OfAPureSensorHasNoMasks) {
  Schema schema;
  describe_extended<described::Sensors>(schema);
  const RowLayout layout = row_layout(schema);
  EXPECT_EQ(layout.block, 0U);
  EXPECT_EQ(layout.mask_words, 0U);
  EXPECT_EQ(layout.size, sizeof(RowHead) + round_up(sizeof(described::Sensors), 8));
}

TEST(RowLayout, HasOneBitAnActuatorInWholeWords) {
  Schema schema;
  const auto type = schema.add_type("float64", {scalar_field("", Kind::float64)});
  schema.add_actuators("", type, 65);
  EXPECT_EQ(row_layout(schema).mask_words, 2U);
}

}  // namespace
}  // namespace o80
