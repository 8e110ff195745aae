// A preview is what the backend then does, bit for bit.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "cases.hpp"
#include "control/motion/state_layout.hpp"
#include "describe/described.hpp"
#include "dice.hpp"
#include "o80/runtime/typed_backend.hpp"
#include "o80/runtime/typed_frontend.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using described::Gripper;
using described::Joint;
using described::MixedRobot;

Limits random_limits(Dice& dice, std::int64_t most = 4) {
  Limits limits;
  const std::int64_t kinds = dice.whole(0, most);
  if (kinds >= 1) {
    limits.minimum = -2;
    limits.maximum = 2;
  }
  if (kinds >= 2) limits.speed = dice.real(0.5, 5);
  if (kinds >= 3) limits.acceleration = dice.real(5, 50);
  if (kinds >= 4) limits.jerk = dice.real(100, 5000);
  limits.noise = 10.0;  // readings are drawn
  return limits;
}

/// Three actuators with fields of several kinds, and two plain ones. `plain`: rows say all of their
/// motion; else some follow when idle, velocities go to rest, and rounded fields have limits of
/// acceleration.
Schema random_robot(Dice& dice, bool plain) {
  Schema schema;
  schema.head.robot = NameText("robot");
  const auto tool = schema.add_type(
      "Tool", {scalar_field("position", Kind::float64), scalar_field("velocity", Kind::float64),
               scalar_field("width", Kind::float32), scalar_field("turns", Kind::int32),
               scalar_field("on", Kind::boolean)});
  schema.add_actuators("tool", tool, 3);
  schema.add_actuators("joint", schema.add_type("float64", {scalar_field("", Kind::float64)}), 2);
  for (std::uint32_t i = 0; i < 3; ++i) {
    if (!plain) schema.actuator(i).rests_at("velocity", 0);
    for (const char* field : {"position", "velocity"}) {
      schema.actuator(i).limits(field, random_limits(dice));
    }
    for (const char* field : {"width", "turns"}) {
      schema.actuator(i).limits(field, random_limits(dice, plain ? 2 : 4));
    }
  }
  for (std::uint32_t i = 3; i < 5; ++i) schema.actuator(i).limits(random_limits(dice));
  for (std::uint32_t i = 0; i < 5; ++i) {
    schema.actuator(i).when_idle(!plain && dice.one_in(2) ? WhenIdle::follow : WhenIdle::hold);
  }
  return schema;
}

/// A robot without a clock, whose positions are observed a little beside the desired ones, and
/// nearer to 0: those that follow do not drift away.
class Random {
 public:
  Random(std::uint32_t seed, bool plain)
      : dice(seed),
        backend(random_robot(dice, plain),
                {.segment = "random", .stale = Stale::purge, .silence = 1'000'000}) {
    backend.publish();
  }
  void iterate() {
    ASSERT_EQ(backend.try_step(), Step::run);
    std::memcpy(backend.observed(), backend.desired(), backend.layout().block);
    for (const ActuatorRow& actuator : backend.schema().actuators) {
      std::byte* const at = backend.observed() + actuator.offset;
      pack(0.99 * unpack<double>(at) + dice.real(-0.01, 0.01), at);
    }
    ASSERT_TRUE(backend.publish());
  }
  void rest() {
    const UntypedFrontend frontend("random");
    do iterate();
    while (frontend.latest().any_braking());
    iterate();
    iterate();
  }

  Dice dice;
  UntypedBackend backend;
};

/// A random command, not always one that the robot can follow.
struct RandomCommand {
  RandomCommand(Dice& dice, const Schema& schema, Iteration next) {
    for (std::uint32_t i = 0; i < schema.actuators.size(); ++i) {
      if (dice.one_in(2)) actuators.push_back(i);
    }
    if (actuators.empty()) actuators.push_back(0);
    for (const std::uint32_t i : actuators) add_target(dice, schema, schema.actuators[i]);
    if (dice.one_in(2)) masks.clear();

    const std::int64_t n = dice.whole(1, 300);
    const PaceSpec paces[] = {direct(),
                              direct(std::chrono::milliseconds(dice.whole(1, 30))),
                              duration(std::chrono::microseconds(n * 997)),
                              speed(dice.real(0.5, 2)),
                              until(next + n - 2),
                              iterations(n),
                              fastest()};
    options.pace = paces[dice.whole(0, 6)];
    const std::optional<Profile> profiles[] = {std::nullopt, Profile::linear, Profile::minimum_jerk,
                                               Profile::as_sent};
    options.profile = profiles[dice.whole(0, 3)];
    if (dice.one_in(4)) options.start = Start::observed;
    if (dice.one_in(4)) options.mode = Mode::overwrite;
  }
  void add_target(Dice& dice, const Schema& schema, const ActuatorRow& actuator) {
    const std::uint32_t size = schema.types[actuator.type].size;
    states.resize(states.size() + size);
    std::byte* const state = states.data() + states.size() - size;
    pack(dice.real(-1.9, 1.9), state);
    if (size == sizeof(double)) return masks.push_back(1);
    pack(dice.real(-1, 1), state + 8);
    pack(static_cast<float>(dice.real(-1.9, 1.9)), state + 16);
    pack(static_cast<std::int32_t>(dice.whole(-1, 1)), state + 20);
    pack(dice.one_in(2), state + 24);
    masks.push_back(static_cast<std::uint64_t>(dice.whole(1, 31)));
  }
  std::uint32_t add_to(UntypedFrontend& frontend) const {
    return frontend.add_commands(actuators, states, options, masks);
  }
  Preview preview_in(const UntypedFrontend& frontend) const {
    return frontend.preview(actuators, states, options, masks);
  }

  std::vector<std::uint32_t> actuators;
  std::vector<std::byte> states;
  std::vector<std::uint64_t> masks;
  CommandOptions options;
};

/// True if these actuators are in a row as they are in a block of a preview. One whose part of the
/// command has ended may follow what it observes.
bool is_in(const UntypedObservation& row, const std::vector<std::uint32_t>& actuators,
           std::span<const std::byte> block) {
  return std::ranges::all_of(actuators, [&](std::uint32_t i) {
    const ActuatorRow& actuator = row.schema().actuators[i];
    const bool has_ended = !row.active(i) || row.braking(i);
    if (actuator.when_idle == WhenIdle::follow && has_ended) return true;
    return StateLayout(row.schema(), actuator.type)
        .same(row.desired() + actuator.offset, block.data() + actuator.offset, nullptr);
  });
}

class PreviewTest : public ManualBackendTest {};

Preview preview_of(const UntypedFrontend& frontend, std::uint32_t actuator, double target,
                   const CommandOptions& options = {}) {
  return frontend.preview({&actuator, 1}, std::as_bytes(std::span(&target, 1)), options);
}
Preview preview_from(const UntypedFrontend& frontend, const UntypedObservation& row, double target,
                     const CommandOptions& options = {}) {
  const std::uint32_t shoulder = 0;
  const auto bytes = std::as_bytes(std::span(&target, 1));
  return frontend.preview_from(row, {&shoulder, 1}, bytes, options);
}

// rule C24
TEST_F(PreviewTest, IsWhatTheBackendThenDoesBitForBit) {
  int previewed = 0;
  int later = 0;
  int refused = 0;
  for (std::uint32_t seed = 1; seed <= cases(30U); ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const bool plain = seed % 2 == 0;
    Random robot(seed, plain);
    UntypedFrontend frontend("random");
    for (int i = 0; i < 20; ++i) {
      const Iteration newest = frontend.published();
      const RandomCommand command(robot.dice, frontend.schema(), newest + 1);
      Preview preview;
      const std::string refusal =
          message_of<InvalidArgument>([&] { preview = command.preview_in(frontend); });
      ASSERT_EQ(frontend.added(), 0U) << "a preview adds nothing";
      std::string refused_by_add = message_of<InvalidArgument>([&] { command.add_to(frontend); });
      if (!refused_by_add.empty()) {
        ASSERT_EQ(refusal, refused_by_add);
        ++refused;
        continue;
      }
      const Batch batch = frontend.pulse();
      for (int k = 0; k < 20'000 && !batch.ended(); ++k) robot.iterate();
      const Handle handle = batch.handle(0);
      // the next command begins at once where the rows say all: not the rounding of a duration
      const bool is_planned = command.options.start == Start::desired &&
                              command.options.profile != Profile::as_sent &&
                              command.options.pace.pace != Pace::duration;
      if (!plain || !is_planned || handle.status == Status::rejected) robot.rest();
      if (handle.status == Status::rejected) {
        ASSERT_EQ(handle.reason, Reason::late);
        ASSERT_THAT(refusal, HasSubstr("too late"));
        continue;
      }
      ASSERT_EQ(handle.status, Status::completed);
      ASSERT_EQ(refusal, "");
      ASSERT_EQ(preview.rows.first, newest + 1);
      ASSERT_EQ(preview.iterations(), handle.iteration - newest);
      ASSERT_EQ(preview.late, handle.late);
      ASSERT_EQ(preview.text, handle.text);
      for (std::size_t k = 0; k < preview.rows.count; ++k) {
        const auto row = frontend.wait_for(newest + 1 + static_cast<Iteration>(k), kAtOnce);
        ASSERT_TRUE(is_in(row, command.actuators, preview.rows.row(k)))
            << "iteration " << k << " of " << preview.rows.count;
      }
      ++previewed;
      later += preview.late > 0 ? 1 : 0;
    }
  }
  EXPECT_GT(previewed, cases(200));
  EXPECT_GT(later, cases(40));
  EXPECT_GT(refused, cases(40));
}

// rule C4
TEST_F(PreviewTest, IsExactForACommandThatOverwritesAPlannedMotion) {
  auto [manual, frontend] = StartedPair({.segment = "pair"}, [](Schema& schema) {
    schema.actuator(0).limits({.speed = 2.0, .acceleration = 15.0, .jerk = 500.0});
    schema.actuator(1).limits({.speed = 3.0, .acceleration = 30.0});
  });
  Dice dice(7);
  const std::array<std::uint32_t, 2> both{0, 1};
  for (int i = 0; i < 50; ++i) {
    SCOPED_TRACE(testing::Message() << "command " << i);
    const std::array<double, 2> targets{dice.real(-1, 1), dice.real(-1, 1)};
    const auto states = std::as_bytes(std::span(targets));
    const CommandOptions options{.pace = iterations(dice.whole(1, 900)), .mode = Mode::overwrite};
    const Preview preview = frontend.preview(both, states, options);
    frontend.add_commands(both, states, options);
    frontend.pulse();
    const auto ran = static_cast<std::size_t>(dice.whole(1, preview.iterations()));
    manual.run(static_cast<int>(ran));
    for (std::size_t k = 0; k < ran; ++k) {
      const auto row = frontend.wait_for(preview.rows.first + static_cast<Iteration>(k), kAtOnce);
      ASSERT_TRUE(is_in(row, {0, 1}, preview.rows.row(k)));
    }
  }
}

TEST_F(PreviewTest, BeginsAtRestAfterAFreshStart) {
  auto [manual, frontend] = StartedPair({.segment = "pair"}, [](Schema& schema) {
    schema.actuator(0).limits({.speed = 2.0, .acceleration = 15.0, .jerk = 500.0});
  });
  send(frontend, 0, 1.0, {.pace = iterations(500)});
  manual.run(200);
  add_request(frontend, Reset{.seed = 3});
  frontend.pulse();
  manual.run(1);
  const CommandOptions options{.pace = iterations(100)};
  const Preview preview = preview_of(frontend, 0, 3.1, options);
  const Preview from_rest = preview_from(frontend, frontend.latest(), 3.1, options);
  ASSERT_EQ(preview.iterations(), from_rest.iterations());
  EXPECT_TRUE(preview.rows.bytes == from_rest.rows.bytes);
}

/// An angle that takes the short way round.
struct Turning {
  double angle = 0;
  static Turning blend(const Turning& from, const Turning& to, double share) {
    return {from.angle + share * std::remainder(to.angle - from.angle, 360.0)};
  }
};
O80_DESCRIBE(Turning, angle);
struct Turntable {
  using Actuators = std::array<Turning, 1>;
};

TEST_F(PreviewTest, RefusesStatesThatCodeOfTheDriverInterpolates) {
  Backend<Turntable> backend({.segment = "turntable"});
  backend.publish({});
  const Frontend<Turntable> frontend("turntable");
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { frontend.preview(frontend.schema().actuators[0].name.view(), Turning{}); }),
              HasSubstr("blend"));
}

TEST_F(PreviewTest, RefusesOnlyTheFieldsThatAnIntegralBounds) {
  Schema schema;
  schema.head.robot = NameText("robot");
  const auto joint = schema.add_type(
      "Joint", {scalar_field("position", Kind::float64), scalar_field("velocity", Kind::float64)});
  schema.add_actuators("joint", joint, 2);
  schema.actuator(1).rests_at("velocity", 0);
  schema.actuator(1).limits("velocity",
                            {.speed = 1, .acceleration = 10, .integral = {"position", -1, 1}});
  UntypedBackend backend(schema, {.segment = "robot"});
  backend.publish();
  const UntypedFrontend frontend("robot");
  const std::array<std::uint32_t, 2> both{0, 1};
  const std::array<Joint, 2> targets{Joint{0.1, 0.2}, Joint{0.1, 0.2}};
  const auto refusal = [&](const std::vector<std::uint64_t>& masks) {
    return message_of<InvalidArgument>([&] {
      frontend.preview(both, std::as_bytes(std::span(targets)), {.pace = iterations(2)}, masks);
    });
  };
  EXPECT_THAT(refusal({}), AllOf(HasSubstr("'joint_1'"), HasSubstr("integral")));
  EXPECT_THAT(refusal({1, 2}), HasSubstr("'joint_1'"));
  EXPECT_EQ(refusal({3, 1}), "");
}

TEST_F(PreviewTest, HasTheTypesOfTheRobot) {
  Backend<MixedRobot> backend({.segment = "mixed"});
  backend.publish({});
  const Frontend<MixedRobot> frontend("mixed");
  const auto one = frontend.preview("joints_3", Joint{.position = 1}, {.pace = iterations(2)});
  ASSERT_EQ(one.iterations(), 2);
  EXPECT_EQ(one.desired(0).joints[3].position, 0.5);
  const auto from = frontend.preview("joints_3", Joint{.position = 1}, {.pace = iterations(2)},
                                     Joint{.position = 2});
  EXPECT_EQ(from.desired(0).joints[3].position, 1.5);
  const auto two =
      frontend.preview({"joints_3", "joints_0"}, {Joint{.position = 1}, Joint{.position = 2}},
                       {.pace = iterations(4)});
  EXPECT_EQ(two.desired(0).joints[3].position, 0.25);
  EXPECT_EQ(two.desired(3).joints[0].position, 2);
  EXPECT_THROW(frontend.preview("gripper", 1.0), InvalidArgument);
  EXPECT_TRUE(frontend.preview("gripper", Gripper{.closed = true}).desired(0).gripper.closed);
}

}  // namespace
}  // namespace o80::test
