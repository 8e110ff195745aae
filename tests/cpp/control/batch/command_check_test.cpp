#include "control/batch/command_check.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "control/rig.hpp"
#include "o80/base/error.hpp"

namespace o80::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

Schema arm() {
  Schema schema;
  schema.head.robot = NameText("arm");
  schema.head.period = kMillisecond;
  for (const auto& [name, value] : {std::pair("open", 1), std::pair("shut", 2)}) {
    LabelRow label;
    label.name = NameText(name);
    label.value = value;
    schema.labels.push_back(label);
  }
  const auto joint = schema.add_type("Joint", {scalar_field("position", Kind::float64, "[rad]"),
                                               scalar_field("torque", Kind::float32, "[Nm]", 2)});
  FieldRow grip = scalar_field("grip", Kind::enumeration);
  grip.size = 1;
  grip.labels = 2;
  const auto gripper = schema.add_type("Gripper", {grip, scalar_field("hot", Kind::boolean)});
  schema.add_actuators("joint", joint, 2);
  schema.add_actuators("gripper", gripper, 1, false);
  schema.actuator(1).name("elbow");
  schema.actuator("elbow").limits({.minimum = -1.5, .maximum = 1.5, .speed = 2.0});
  schema.actuator("elbow").limits("torque", {.minimum = -3.0, .maximum = 3.0});
  schema.add_request("shake", gripper, "shake it");
  return schema;
}

struct Joint {
  double position = 0.0;
  float torque[2] = {0.0F, 0.0F};
};

template <class Call>
std::string refusal_of(Call&& call) {
  try {
    call();
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "nothing was refused";
}

class CommandCheckTest : public testing::Test {
 protected:
  std::string refusal_of_target(std::uint32_t actuator, const Joint& joint,
                                const std::vector<std::uint64_t>& mask = {}) {
    return refusal_of([&] { check.targets(actuator, bytes_of_one(joint), mask); });
  }
  Schema schema = arm();
  CommandCheck check{schema};
};

TEST_F(CommandCheckTest, WhatIsWithinTheLimitsPasses) {
  EXPECT_NO_THROW(check.targets(1, bytes_of_one(Joint{1.5, {-3.0F, 3.0F}})));
  EXPECT_NO_THROW(check.targets(0, bytes_of_one(Joint{1e300, {1e30F, 0.0F}})));
  EXPECT_NO_THROW(check.speed(1, 2.0));
  EXPECT_NO_THROW(check.speed(0, 1e9));
}

// rule L1
TEST_F(CommandCheckTest, ATargetOutsideItsLimitsIsRefusedNamingAllThereIsToKnow) {
  EXPECT_THAT(refusal_of_target(1, {1.75, {}}),
              AllOf(HasSubstr("'elbow' (1)"), HasSubstr("'position'"), HasSubstr("1.75 [rad]"),
                    HasSubstr("from -1.5 to 1.5 [rad]")));
  EXPECT_THAT(refusal_of_target(1, {0.0, {0.0F, -4.0F}}),
              AllOf(HasSubstr("'torque[1]'"), HasSubstr("-4 [Nm]"), HasSubstr("from -3 to 3")));
}

// rule L1
TEST_F(CommandCheckTest, NanAndInfinityAreRefusedWhateverTheLimits) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_THAT(refusal_of_target(0, {std::nan(""), {}}), HasSubstr("not a finite number"));
  EXPECT_THAT(refusal_of_target(0, {-kInfinity, {}}), HasSubstr("not a finite number"));
  EXPECT_THAT(refusal_of_target(1, {0.0, {INFINITY, 0.0F}}), HasSubstr("not a finite number"));
  Schema plain = plain_robot(1);
  const CommandCheck of_plain(plain);
  EXPECT_THAT(refusal_of([&] { of_plain.targets(0, bytes_of_one(-std::nan(""))); }),
              AllOf(HasSubstr("target nan for"), HasSubstr("'joint_0' (0)")));
  EXPECT_NO_THROW(of_plain.targets(0, bytes_of_one(std::numeric_limits<double>::max())));
}

TEST_F(CommandCheckTest, NumbersLeftOutAreNotLookedAt) {
  EXPECT_NO_THROW(check.targets(1, bytes_of_one(Joint{std::nan(""), {1.0F, 99.0F}}),
                                std::vector<std::uint64_t>{0b010}));
  EXPECT_THAT(refusal_of_target(1, {std::nan(""), {1.0F, 99.0F}}, {0b100}),
              HasSubstr("'torque[1]'"));
}

TEST_F(CommandCheckTest, EveryRowOfATrajectoryIsLookedAt) {
  const std::vector<Joint> rows{{0.0, {}}, {1.0, {}}, {9.0, {}}};
  EXPECT_THAT(refusal_of([&] { check.targets(1, bytes_of(rows)); }), HasSubstr("9 [rad]"));
  EXPECT_THAT(refusal_of([&] { check.targets(1, std::vector<std::byte>(17)); }),
              AllOf(HasSubstr("16 bytes"), HasSubstr("17")));
  EXPECT_THAT(refusal_of([&] { check.targets(1, {}); }), HasSubstr("16 bytes"));
}

TEST_F(CommandCheckTest, AnUnknownActuatorIsRefusedListingWhatThereIs) {
  EXPECT_EQ(check.actuator("elbow"), 1U);
  EXPECT_EQ(check.actuator(std::int64_t{2}), 2U);
  for (const std::string& text : {refusal_of([&] { check.actuator("knee"); }),
                                  refusal_of([&] { check.actuator(std::int64_t{3}); }),
                                  refusal_of([&] { check.actuator(std::int64_t{-1}); })}) {
    EXPECT_THAT(text, ::testing::ContainsRegex(
                          "'arm' has no actuator .*; there are: joint_0.*, elbow.*, gripper"));
  }
  EXPECT_THAT(refusal_of([&] { check.actuator("knee"); }), HasSubstr("'knee'"));
}

TEST_F(CommandCheckTest, ASpeedAboveTheMaximumIsRefused) {
  EXPECT_THAT(
      refusal_of([&] { check.speed(1, 2.5); }),
      AllOf(HasSubstr("2.5 [rad/s]"), HasSubstr("'elbow' (1)"), HasSubstr("maximum: 2 [rad/s]")));
  for (const double speed : {0.0, -1.0, std::nan(""), HUGE_VAL}) {
    EXPECT_THAT(refusal_of([&] { check.speed(0, speed); }),
                HasSubstr("must be positive and finite"));
  }
}

TEST_F(CommandCheckTest, EnumerationsAndBooleansAreWhatTheyMayBe) {
  const auto gripper = [](std::uint8_t grip, std::uint8_t hot) {
    return std::vector<std::byte>{std::byte{grip}, std::byte{hot}};
  };
  EXPECT_NO_THROW(check.targets(2, gripper(2, 1)));
  EXPECT_THAT(refusal_of([&] { check.targets(2, gripper(3, 1)); }),
              AllOf(HasSubstr("'grip'"), HasSubstr("open (1), shut (2)")));
  EXPECT_THAT(refusal_of([&] { check.targets(2, gripper(1, 2)); }), HasSubstr("'hot'"));
  EXPECT_NO_THROW(check.request(0, gripper(1, 0)));
  EXPECT_THAT(refusal_of([&] { check.request(0, gripper(0, 0)); }), HasSubstr("'shake'"));
  EXPECT_THAT(refusal_of([&] { check.request(0, {}); }), HasSubstr("must have 2 bytes, got 0"));
  EXPECT_THAT(refusal_of([&] { check.request(1, {}); }),
              HasSubstr("has no request 1; there are: shake"));
}

}  // namespace
}  // namespace o80::test
