// Which readings an embedded backend begins with, and those of actuators that follow.

#include <cmath>
#include <limits>
#include <random>

#include "cases.hpp"
#include "o80/runtime/typed_backend.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using EmbeddedReadingTest = ManualBackendTest;
using FollowerTest = ManualBackendTest;

constexpr Limits kLimits{.minimum = -2.0, .maximum = 2.0, .speed = 1.0, .error = 0.3};
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Schema pair_with(const Limits& limits, WhenIdle when_idle = WhenIdle::hold) {
  Schema schema;
  schema.head.robot = NameText("pair");
  describe_types<test::Pair>(schema);
  schema.actuator(0).name("shoulder").limits(limits).when_idle(when_idle);
  schema.actuator(1).name("elbow");
  return schema;
}

bool publish(UntypedBackend& backend, double shoulder) {
  pack(std::array{shoulder, 0.0}, backend.observed());
  return backend.publish();
}

// rule R3
TEST_F(EmbeddedReadingTest, OfRowZeroMustLieWithinItsBounds) {
  UntypedBackend backend(pair_with(kLimits), {.segment = "pair"});
  for (const double wrong : {2.31, -2.31, 1e300, kInfinity, std::nan("")}) {
    EXPECT_FALSE(publish(backend, wrong)) << wrong;
    EXPECT_THAT(std::string(backend.failure()), HasSubstr("actuator 'shoulder'"));
  }
  EXPECT_TRUE(publish(backend, 2.29));
  EXPECT_EQ(std::string(backend.failure()), "");
  EXPECT_EQ(backend.try_step(), Step::run);
}

TEST_F(EmbeddedReadingTest, AfterRowZeroMustBeWhereTheRobotCanHaveCome) {
  // the period bounds what the robot can do, however little time passes
  const std::int64_t period = 1'000'000;
  for (const double step : {0.0, 0.03, -0.03, 1e5, -1e300, kInfinity, std::nan("")}) {
    UntypedBackend backend(pair_with({.speed = 1.0, .error = 0.3}),
                           {.segment = "pair", .period = period});
    ASSERT_TRUE(publish(backend, 0.5));
    ASSERT_EQ(backend.try_step(), Step::run);
    EXPECT_EQ(unpack<double>(backend.desired()), 0.5);
    const bool is_right = std::abs(step) < 0.1;
    EXPECT_EQ(publish(backend, 0.5 + step), is_right) << step;
    EXPECT_EQ(backend.try_step(), is_right ? Step::run : Step::ended);
    if (is_right) {
      EXPECT_TRUE(publish(backend, 0.5)) << "later ones are judged by the error limit";
    } else {
      EXPECT_THAT(std::string(backend.failure()),
                  AllOf(HasSubstr("actuator 'shoulder' was read at"),
                        HasSubstr("begin with accept_reading")));
      EXPECT_EQ(backend.iteration(), 1) << "the row was not published";
    }
  }
}

TEST_F(EmbeddedReadingTest, IsAcceptedIfTheProgramSaysSo) {
  UntypedBackend backend(pair_with(kLimits), {.segment = "pair", .accept_reading = true});
  EXPECT_TRUE(publish(backend, 5.0));
  ASSERT_EQ(backend.try_step(), Step::run);
  EXPECT_TRUE(publish(backend, -5.0));
}

TEST_F(EmbeddedReadingTest, OfASimulationMayBeAnything) {
  UntypedBackend backend(pair_with(kLimits), {.segment = "pair", .bursting = true});
  EXPECT_TRUE(publish(backend, 5.0));
}

// ------------------------------------------------------------------------- resumes

using ResumedReadingTest = ManualBackendTest;

/// Plays a trace of a bursting pair whose shoulder has these limits; of the world, or a simulation.
void play_with(const Limits& limits, const std::string& script, bool of_the_world = true) {
  play({.segment = "pair", .bursting = true, .has_loop = true}, script, [&](Schema& schema) {
    schema.actuator(0).limits(limits);
    schema.head.of_the_world = of_the_world ? 3 : 2;
  });
}

// rule R4
TEST_F(ResumedReadingTest, OneTurnOffInEveryRowIsRefusedUntilItIsAccepted) {
  play_with({.speed = 2.0, .error = 0.3}, R"(burst 10; offset 0 6.283; burst 1; burst 5000
    halted error; a = resume 1; drive; a rejected reading
    a says 'shoulder' was read at 6.283 after 0; a says resume with --accept-reading
    0 is 0; b = resume 1 accepting; drive; b completed; 0 is 6.283)");
}

TEST_F(ResumedReadingTest, TheNoiseThatADriverDescribesIsAllowedAndNoMore) {
  // with a limit of speed, beside it; without, alone
  for (const Limits& limits : {Limits{.speed = 2.0, .error = 5.0, .noise = 0.05},
                               Limits{.error = 5.0, .noise = 0.05}, Limits{.noise = 0.05}}) {
    const double reach = 0.05 + (std::isfinite(limits.speed) ? 0.002 : 0.0);
    for (const double step : {0.99, -0.99, 1.01, -1.01}) {
      play_with(limits, "halt; burst 1; burst 3; offset 0 " + std::to_string(step * reach) +
                            "; a = resume 1; drive; a " +
                            (std::abs(step) < 1.0 ? "completed" : "rejected reading"));
    }
  }
}

// rule R1
TEST_F(ResumedReadingTest, ARobotOfTheWorldCannotComeFarByARequest) {
  play_with({.speed = 2.0}, R"(burst 10; a = reset 7; burst 3; halted; a says was read at 7 after 0
    0 is 0; b = resume 1 accepting; drive; b completed)");
  play_with({.speed = 2.0}, "burst 10; a = reset 7; burst 3; running; 0 is 7", false);
}

TEST_F(ResumedReadingTest, AFreshStartBeforeAHaltIsNoStep) {
  play_with({.speed = 2.0}, R"(burst 10; a = reset 7; drive; halt; burst 1; burst 3; b = resume 1
    drive; b completed)",
            false);
}

/// A pair whose shoulder follows, moved by hand.
class Follower {
 public:
  explicit Follower(const Limits& limits)
      : backend(pair_with(limits, WhenIdle::follow), {.segment = "pair", .period = 1'000'000}) {
    publish(backend, now);
  }
  void run(int iterations) {
    for (int i = 0; i < iterations; ++i) {
      ASSERT_EQ(backend.try_step(), Step::run);
      written = unpack<double>(backend.desired());
      ASSERT_TRUE(publish(backend, now + offset));
    }
  }
  UntypedBackend backend;
  double now = 0.0;
  double offset = 0.0;
  double written = 0.0;
};

// rule R2
TEST_F(FollowerTest, IsCommandedOnlyFromWhereItCanBe) {
  std::mt19937 random(9);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  for (int i = 0; i < cases(60); ++i) {
    Limits limits{.speed = uniform(0.5, 4.0)};
    limits.noise = uniform(0.01, 0.1);
    Follower follower(limits);
    UntypedFrontend frontend("pair");
    follower.run(3);
    // an arm that is right is never refused, also while somebody moves it
    for (int k = 0; k < 20; ++k) {
      follower.now += uniform(-1.0, 1.0) * limits.speed * 1e-3;
      follower.offset = uniform(-0.49, 0.49) * limits.noise;
      follower.run(1);
    }
    const Batch good = send(frontend, 0, follower.now, {.pace = iterations(5)});
    follower.offset = 0.0;
    follower.run(400);
    ASSERT_EQ(good.handle(0).status, Status::completed) << good.handle(0).text;

    // far enough that no delay of this machine makes it plausible, in one row or in all
    const double wrong = std::copysign(1e5 * std::pow(10.0, uniform(0.0, 290.0)), uniform(-1, 1));
    follower.offset = i % 3 == 0 ? kInfinity : wrong;
    follower.run(1);
    if (i % 2 == 0) follower.run(3000);
    add(frontend, 1, 1.0);
    add(frontend, 0, 1.0, {.pace = iterations(5)});
    const Batch bad = frontend.pulse();
    follower.run(1);
    for (const Handle& handle : bad.handles()) {
      EXPECT_EQ(handle.status, Status::rejected) << i;
      EXPECT_EQ(handle.reason, Reason::reading);
      EXPECT_THAT(handle.text, AllOf(HasSubstr("actuator 'shoulder' was read at"),
                                     HasSubstr("resume with --accept-reading")));
    }
    // it comes back, and is followed to there
    follower.offset = 0.0;
    follower.run(1);
    const Batch early = send(frontend, 0, 0.0, {.pace = iterations(5)});
    follower.run(1);
    EXPECT_EQ(early.handle(0).reason, Reason::reading);
    EXPECT_EQ(follower.written, follower.now);
    const Batch again = send(frontend, 0, 0.0, {.pace = iterations(5)});
    follower.run(400);
    EXPECT_EQ(again.handle(0).status, Status::completed) << again.handle(0).text;
  }
}

/// Plays a trace of a pair whose shoulder follows.
void play_following(const std::string& script) {
  play({.segment = "pair", .period = 1'000'000}, script, [](Schema& schema) {
    schema.actuator(0).limits({.speed = 2.0, .noise = 0.03}).when_idle(WhenIdle::follow);
  });
}

TEST_F(FollowerTest, OneTurnOffInEveryRowIsAcceptedByAResumeOnly) {
  play_following(R"(run 3; in 4 read 0 6.283e5; run 5; a = 0 to 6.283e5 over 5; run 1
    a rejected reading; halt; run 3; r = resume 1 accepting; run 1; r completed
    0 is 6.283e5; b = 0 to 6.283e5 over 5; run 6; b completed)");
}

TEST_F(FollowerTest, OfACommandOfSeveralIsJudgedWhenTheyBegin) {
  for (const std::string wrong : {"0", "1e5", "-1e300", "inf", "nan"}) {
    for (const bool while_waiting : {true, false}) {
      // in one row, the last one before they begin or an earlier one
      const int row = while_waiting ? 8 : 13;
      const bool begins = while_waiting || wrong == "0";
      play_following("run 3; 1 to 1 over 10; 0,1 to 0.004 2 over 5; 0 to 0 over 5; b = pulse; in " +
                     std::to_string(row) + " read 0 " + wrong + "; in " + std::to_string(row + 1) +
                     " read 0 0; run 10; b completed; b.1 queued; run 1;" +
                     (begins ? "0 is 0.0008; run 400; b.1 completed none; b.2 completed none"
                             : R"(run 400; b.1 interrupted reading; b.2 interrupted reading
          b.1 says actuator 'shoulder' was read at; b.1 says resume with --accept-reading
          b.2 says an implausible reading ended all commands; b.2 says of its actuator)") +
                     "; 1 is 2  # the others go on");
    }
  }
}

TEST_F(FollowerTest, TwoThatAreMisreadAtOnceAreToldEachItsOwnReading) {
  Schema schema;
  schema.head.robot = NameText("arm");
  schema.add_actuators("joint", schema.add_type("double", {scalar_field("", Kind::float64)}), 4);
  for (std::uint32_t i = 0; i < 4; ++i) {
    schema.actuator(i).limits({.speed = 2.0, .noise = 0.03});
    if (i < 2) schema.actuator(i).when_idle(WhenIdle::follow);
  }
  UntypedBackend backend(std::move(schema), {.segment = "arm", .period = 1'000'000});
  const auto run = [&](std::array<double, 4> read) {
    ASSERT_EQ(backend.try_step(), Step::run);
    pack(read, backend.observed());
    ASSERT_TRUE(backend.publish());
  };
  pack(std::array<double, 4>{}, backend.observed());
  ASSERT_TRUE(backend.publish());
  UntypedFrontend frontend("arm");
  run({});
  // each follower waits for an actuator that still moves
  constexpr std::array<double, 2> kTargets{0.004, 0.004};
  for (std::uint32_t i = 2; i < 4; ++i) add(frontend, i, 0.01, {.pace = iterations(10)});
  for (std::uint32_t i = 0; i < 2; ++i) {
    frontend.add_commands(std::array{i, i + 2}, std::as_bytes(std::span(kTargets)),
                          {.pace = iterations(5)});
  }
  const Batch batch = frontend.pulse();
  for (int i = 0; i < 9; ++i) run({});
  run({1e5, -2e5, 0.0, 0.0});
  for (int i = 0; i < 20; ++i) run({});
  for (const std::size_t i : {std::size_t{0}, std::size_t{1}}) {
    const Handle handle = batch.handle(2 + i);
    EXPECT_EQ(handle.status, Status::interrupted);
    EXPECT_EQ(handle.reason, Reason::reading);
    EXPECT_THAT(handle.text,
                HasSubstr(i == 0 ? "'joint_0' was read at 1e+05" : "'joint_1' was read at -2e+05"));
  }
}

/// An arm whose position follows while its torque goes to rest.
struct Held {
  double position = 0;
  double torque = 0;
};

TEST_F(FollowerTest, IsJudgedWhileItsTorqueGoesToRest) {
  Schema schema;
  schema.head.robot = NameText("held");
  schema.add_actuators("arm",
                       schema.add_type("Held", {scalar_field("position", Kind::float64),
                                                scalar_field("torque", Kind::float64)}),
                       1);
  schema.actuator(0).when_idle(WhenIdle::follow);
  schema.actuator(0).limits("position", {.speed = 2.0, .noise = 0.03});
  schema.actuator(0).limits("torque", {.speed = 1.0}).rests_at("torque", 0.0);
  UntypedBackend backend(std::move(schema), {.segment = "held", .period = 1'000'000});
  std::optional<UntypedFrontend> frontend;
  const auto publish = [&](double position) {
    pack(Held{position, 0.0}, backend.observed());
    ASSERT_TRUE(backend.publish());
  };
  const auto send = [&](const Held& target, const CommandOptions& options) {
    frontend->add_command(0, std::as_bytes(std::span(&target, 1)), options);
    return frontend->pulse();
  };
  publish(0.0);
  frontend.emplace("held");
  const Batch first = send({0.0, 0.5}, {.pace = iterations(500)});
  for (int i = 0; i < 500; ++i) {
    ASSERT_EQ(backend.try_step(), Step::run);
    publish(0.0);
  }
  ASSERT_EQ(first.handle(0).status, Status::completed);
  ASSERT_EQ(backend.try_step(), Step::run);
  publish(1e5);
  ASSERT_EQ(backend.braking()[0], 1U);
  const Batch next = send({0.0, 0.0}, {.pace = iterations(5)});
  ASSERT_EQ(backend.try_step(), Step::run);
  publish(0.0);
  EXPECT_EQ(next.handle(0).status, Status::rejected);
  EXPECT_EQ(next.handle(0).reason, Reason::reading);
}

}  // namespace
}  // namespace o80::test
