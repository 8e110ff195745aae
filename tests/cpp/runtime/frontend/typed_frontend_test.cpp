#include "o80/runtime/typed_frontend.hpp"

#include "describe/described.hpp"
#include "o80/runtime/typed_backend.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using described::ControlMode;
using described::Gripper;
using described::Joint;
using described::LaunchBall;
using described::MixedRobot;

class TypedTest : public ManualBackendTest {};

class MixedRobotTest : public ManualBackendTest {
 protected:
  MixedRobotTest() {
    backend.publish({});
    frontend.emplace("mixed");
  }

  Backend<MixedRobot> backend{{.segment = "mixed"}};
  std::optional<Frontend<MixedRobot>> frontend;
};

/// Another idea of the mixed robot.
struct OtherJoint {
  double position = 0, torque = 0;
};
O80_DESCRIBE(OtherJoint, (position, "[rad]"), (torque, "[Nm]"));
struct OtherRobot {
  using Actuators = std::array<OtherJoint, 7>;
};

struct Thermometer {
  struct Reading {
    double celsius = 0;
  };
  using Actuators = NoActuators;
  using Extended = Reading;
};
O80_DESCRIBE(Thermometer::Reading, (celsius, "[°C]"));

TEST_F(MixedRobotTest, CommandsARobotOfMixedStatesByNameAndByIndex) {
  frontend->add_command("joints_3", Joint{.position = 1, .velocity = 2});
  frontend->add_command("gripper", Gripper{.width = 0.5F, .closed = true});
  frontend->add_command(8, ControlMode::torque);
  frontend->pulse();
  const auto desired = backend.step();
  ASSERT_TRUE(desired);
  EXPECT_EQ(desired->joints[3].velocity, 2);
  EXPECT_TRUE(desired->gripper.closed);
  EXPECT_EQ(desired->mode, ControlMode::torque);
  described::Sensors sensors;
  sensors.matrix[2][1] = 4;
  backend.publish(*desired, sensors);
  const Observation<MixedRobot> row = frontend->latest();
  EXPECT_EQ(row.observed().joints[3].position, 1);
  EXPECT_EQ(row.desired().gripper.width, 0.5F);
  EXPECT_EQ(row.extended().matrix[2][1], 4);
}

TEST_F(MixedRobotTest, CommandsSeveralActuatorsOfOneTypeAtOnce) {
  frontend->add_commands({"joints_3", "joints_0"}, {Joint{.position = 1}, Joint{.position = 2}},
                         {.pace = iterations(2)});
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { frontend->add_commands({"joints_3", "gripper"}, {Joint{}, Joint{}}); }),
              HasSubstr("'gripper'"));
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { frontend->add_commands({"joints_3", "joints_0"}, {Joint{}}); }),
              HasSubstr("2 actuators"));
  const Batch batch = frontend->pulse({.seen = frontend->latest()});
  EXPECT_EQ(batch.size(), 1U);
  EXPECT_EQ(batch.seen()->epoch, frontend->epoch());
  const auto desired = backend.step();
  ASSERT_TRUE(desired);
  EXPECT_EQ(desired->joints[3].position, 0.5);
  EXPECT_EQ(desired->joints[0].position, 1);
}

TEST_F(TypedTest, MovesToTargetsAndWaitsUntilTheyAreObserved) {
  Backend<MixedRobot> backend({.segment = "mixed", .bursting = true});
  backend.publish({});
  std::thread runner([&] {
    while (const auto desired = backend.step()) backend.publish(*desired);
  });
  Frontend<MixedRobot> frontend("mixed");
  const MoveOptions options{.command = {.pace = iterations(2)}, .tolerance = 0.1};
  const auto one = frontend.move_to("joints_3", Joint{.position = 1}, options, kPatience);
  EXPECT_EQ(one.observed().joints[3].position, 1);
  const auto two = frontend.move_to(
      {"joints_3", "joints_0"}, {Joint{.position = 2}, Joint{.position = 3}}, options, kPatience);
  EXPECT_EQ(two.observed().joints[3].position, 2);
  EXPECT_EQ(two.observed().joints[0].position, 3);
  EXPECT_EQ(frontend.move_to("gripper", Gripper{.closed = true}, options).observed().gripper.closed,
            true);
  EXPECT_THROW(frontend.move_to("gripper", 1.0, options), InvalidArgument);
  frontend.add_command("joints_0", Joint{}, {.pace = until(1)});
  EXPECT_THROW(frontend.pulse_and_wait(kPatience), NotCompleted);
  frontend.add_command("joints_0", Joint{}, {.pace = until(1)});
  frontend.pulse_and_wait(kPatience, {}, {.check = false});
  backend.untyped().ask_to_stop();
  runner.join();
}

TEST_F(MixedRobotTest, RefusesAStateOfAnotherTypeEvenIfItHasTheSameSize) {
  EXPECT_THAT(message_of<InvalidArgument>([&] { frontend->add_command("gripper", 1.0); }),
              HasSubstr("'gripper'"));
  EXPECT_THROW(frontend->add_command("mode", std::uint8_t{3}), InvalidArgument);
  EXPECT_THROW(frontend->add_command("mode", static_cast<ControlMode>(17)), InvalidArgument);
  EXPECT_THROW(frontend->add_command(99, 1.0), InvalidArgument);
}

TEST_F(MixedRobotTest, RefusesARobotThatIsLaidOutOtherwiseShowingTheDifference) {
  EXPECT_THAT(message_of<SchemaMismatch>([] { Frontend<OtherRobot> other("mixed"); }),
              AllOf(HasSubstr("'mixed'"), HasSubstr("actuators: expected 7, found 9"),
                    HasSubstr("actuator 0 field 'torque'"), HasSubstr("from the same types")));
}

TEST_F(TypedTest, AcceptsNamesAndLimitsThatTheBackendGives) {
  Backend<MixedRobot> backend({.segment = "mixed"}, [](Schema& schema) {
    schema.actuator(0).name("base").limits({.minimum = -1, .maximum = 1});
  });
  backend.publish({});
  Frontend<MixedRobot> frontend("mixed");
  frontend.add_command("base", Joint{.position = 0.5});
  EXPECT_THROW(frontend.add_command("base", Joint{.position = 1.5}), InvalidArgument);
}

TEST_F(TypedTest, RowsOfPaddedStatesCompareBitForBit) {
  const auto run = [] {
    Backend<MixedRobot> backend({.segment = "mixed", .bursting = true});
    described::Actuators dirty;
    described::Sensors sensors;
    std::memset(static_cast<void*>(&dirty), 0x5A, sizeof dirty);
    std::memset(static_cast<void*>(&sensors), 0xA5, sizeof sensors);
    dirty = described::Actuators{};
    sensors = described::Sensors{};
    backend.publish(dirty, sensors);
    return Frontend<>("mixed").history(1).bytes;
  };
  EXPECT_EQ(run(), run());
}

TEST_F(TypedTest, APureSensorHasNoActuators) {
  Backend<Thermometer> backend({.segment = "room"});
  backend.publish({}, {.celsius = 20});
  Frontend<Thermometer> frontend("room");
  ASSERT_TRUE(backend.step());
  backend.publish({}, {.celsius = 21});
  const Observation<Thermometer> row = frontend.latest();
  EXPECT_EQ(row.iteration(), 1);
  EXPECT_EQ(row.extended().celsius, 21);
  static_cast<void>(row.desired());
  EXPECT_THAT(message_of<InvalidArgument>([&] { frontend.add_command(0, 1.0); }),
              HasSubstr("no actuators"));
}

TEST_F(MixedRobotTest, FollowsATrajectory) {
  const std::array<Joint, 3> rows{Joint{1, 0}, Joint{2, 0}, Joint{3, 0}};
  frontend->add_trajectory("joints_0", std::span<const Joint>(rows));
  frontend->pulse();
  for (const Joint& row : rows) {
    const auto desired = backend.step();
    ASSERT_TRUE(desired);
    EXPECT_EQ(desired->joints[0].position, row.position);
    backend.publish(*desired);
  }
}

TEST_F(MixedRobotTest, PlaysAChunkAndSaysWhatBecameOfIt) {
  const std::array<Joint, 3> rows{Joint{1, 0}, Joint{2, 0}, Joint{3, 0}};
  const std::array<std::uint32_t, 3> due{2, 5, 9};
  frontend->add_chunk("joints_0", due, std::span<const Joint>(rows), {.anchor = 0, .ease = 1});
  const Batch batch = frontend->pulse();
  EXPECT_FALSE(batch.shift());
  EXPECT_FALSE(batch.take_over());
  for (Iteration now = 1; now <= 9; ++now) {
    const auto desired = backend.step();
    ASSERT_TRUE(desired);
    const auto row = std::ranges::find(due, static_cast<std::uint32_t>(now));
    if (row != due.end()) {
      EXPECT_EQ(desired->joints[0].position,
                rows[static_cast<std::size_t>(row - due.begin())].position);
    }
    backend.publish(*desired);
  }
  ASSERT_TRUE(batch.shift());
  EXPECT_EQ(batch.shift()->iterations, 0);
  ASSERT_TRUE(batch.take_over());
  EXPECT_EQ(batch.take_over()->row, 0U);
  EXPECT_EQ(batch.handle(0).status, Status::completed);

  const auto refuses = [&](std::vector<std::uint32_t> wrong, const ChunkOptions& options) {
    EXPECT_THROW(frontend->add_chunk("joints_0", wrong, std::span<const Joint>(rows), options),
                 InvalidArgument);
  };
  refuses({2, 5}, {});
  refuses({2, 2, 9}, {});
  refuses({0, 5, 9}, {});
  refuses({2, 5, 9}, {.ease = (std::uint32_t{1} << 31) + 1});
  refuses({2, 5, 9}, {.first = 3});
  refuses({2, 5, 9}, {.profile = Profile::minimum_jerk});
  EXPECT_EQ(frontend->added(), 0U);
}

}  // namespace
}  // namespace o80::test
