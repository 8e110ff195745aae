// Balls of a running simulation: imposed, replayed, hit, teleported.

#include "balls/balls.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "scenes.hpp"

namespace o80::mujoco {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::HasSubstr;
using testing::Pointwise;
using testing::ThrowsMessage;

constexpr double kBenchTop = 0.55;

using BallsTest = SceneTest;

TEST_F(BallsTest, ABallIsImposedWhileCommandedAndFliesOnAfterwards) {
  Inline robot(court());
  const Shot shot{{0.2, 1.0, 1.2}, {0.5, 2, 1}};
  for (int i = 0; i < 10; ++i) robot.ask("ball", shot.at(i));
  const Seen last = robot.burst(10);
  EXPECT_EQ(last.observed<BallState>(4).position, shot.at(9).position);
  EXPECT_EQ(last.observed<BallState>(4).velocity, shot.at(9).velocity);
  EXPECT_TRUE(last.row.active(4));

  const Seen free = robot.burst(1);
  EXPECT_FALSE(free.row.active(4));
  const Ball before{vector(shot.at(9).position), vector(shot.at(9).velocity), {30, 0, 0}};
  const Air air = Air::of(1.2, {0.47, 1.0}, 0.02, 0.0027, 0.5, {0, 0, -9.81});
  const Ball after = flown(before, air, 0.002);
  EXPECT_THAT(free.observed<BallState>(4).position,
              Pointwise(DoubleNear(1e-15), numbers(after.position)));
  EXPECT_THAT(free.observed<BallState>(4).velocity,
              Pointwise(DoubleNear(1e-15), numbers(after.velocity)));
}

TEST_F(BallsTest, AnImposedBallPassesThroughSurfacesThatAreNotWatched) {
  Inline robot(court());
  for (int i = 0; i < 5; ++i) robot.ask("ball", Shot{{0.4, 1.0, 0.585}, {0, -2, -10}}.at(i));
  const Seen inside = robot.burst(5);

  EXPECT_LT(inside.observed<BallState>(4).position[2], kBenchTop);
  EXPECT_EQ(inside.bench().count, 0);
}

TEST_F(BallsTest, AnImposedSpinIsObservedAndTurnsTheFreeFlight) {
  const double spins[] = {-100, 0, 100};
  double heights[3];
  for (int n = 0; n < 3; ++n) {
    Inline robot(court({{"spin_decay", "0"}}));
    const Shot shot{{0.4, 2.0, 1.2}, {0, -4, 0}, {spins[n], 0, 0}};
    for (int i = 0; i < 5; ++i) robot.ask("ball", shot.at(i));
    EXPECT_EQ(robot.burst(5).observed<BallState>(4).spin, numbers(shot.spin));
    const Seen free = robot.burst(50);
    EXPECT_EQ(free.observed<BallState>(4).spin, numbers(shot.spin));
    heights[n] = free.observed<BallState>(4).position[2];
  }
  EXPECT_GT(heights[0], heights[1] + 0.005);
  EXPECT_GT(heights[1], heights[2] + 0.005);
}

TEST_F(BallsTest, TheSpinOfAnImposedBallActsAtItsContact) {
  Inline robot(court());
  Shot shot = shot_at_the_paddle(robot);
  shot.spin = {40, -20, 60};
  for (int i = 0; i < 60; ++i) robot.ask("ball", shot.at(i));
  Seen seen = robot.burst(1);
  for (int i = 0; i < 60 && seen.paddle().count == 0; ++i) seen = robot.burst(1);

  const WatchedContacts paddle = seen.paddle();
  ASSERT_EQ(paddle.count, 1);
  const Vector normal = vector(paddle.normal);
  const Vector plain = 0.78 * (shot.velocity - 2 * dot(shot.velocity, normal) * normal);
  // the surface of the ball moves by spin, and friction takes 0.22 of that
  const Vector by_spin = (0.22 * 0.02) * cross(shot.spin, normal);
  EXPECT_THAT(paddle.velocity_after, Pointwise(DoubleNear(1e-12), numbers(plain + by_spin)));
  EXPECT_GT(length(vector(seen.observed<BallState>(4).spin) - shot.spin), 1.0);
}

TEST_F(BallsTest, AWatchedSurfaceEndsTheReplayInTheIterationOfTheContact) {
  Inline robot(court());
  Shot shot = shot_at_the_paddle(robot);
  shot.spin = {};
  for (int i = 0; i < 60; ++i) robot.ask("ball", shot.at(i));
  Batch batch = robot.frontend.pulse();
  Seen seen = robot.burst(1);
  int i = 0;
  while (seen.paddle().count == 0 && ++i < 60) {
    EXPECT_EQ(seen.observed<BallState>(4).position, shot.at(i - 1).position);
    seen = robot.burst(1);
  }

  const WatchedContacts paddle = seen.paddle();
  ASSERT_EQ(paddle.count, 1);
  EXPECT_EQ(paddle.iteration, seen.row.iteration());
  EXPECT_GT(paddle.fraction, 0.0);
  EXPECT_LT(paddle.fraction, 1.0);
  EXPECT_EQ(paddle.smallest_distance, 0.0);
  EXPECT_EQ(paddle.velocity_before, numbers(shot.velocity));
  EXPECT_EQ(paddle.surface_velocity, (Numbers{}));
  // the normal part changes its sign, and each part keeps its share
  const Vector normal = vector(paddle.normal);
  EXPECT_THAT(paddle.velocity_after,
              Pointwise(DoubleNear(1e-12),
                        numbers(0.78 * (shot.velocity - 2 * dot(shot.velocity, normal) * normal))));
  // the rest of the iteration is flown with that velocity
  const Vector moved = vector(seen.observed<BallState>(4).position) - vector(paddle.position);
  const Vector expected =
      0.02 * normal + (0.002 * (1 - paddle.fraction)) * vector(paddle.velocity_after);
  EXPECT_THAT(numbers(moved), Pointwise(DoubleNear(5e-5), numbers(expected)));

  // all later commands of the ball end as interrupted, in this iteration
  EXPECT_EQ(batch.handle(static_cast<std::size_t>(i)).status, Status::completed);
  for (const std::size_t n : {static_cast<std::size_t>(i + 1), std::size_t{59}}) {
    EXPECT_EQ(batch.handle(n).status, Status::interrupted);
    EXPECT_EQ(batch.handle(n).iteration, seen.row.iteration());
  }

  // and the ball flies freely from now on
  const Seen next = robot.burst(1);
  EXPECT_FALSE(next.row.active(4));
  EXPECT_EQ(next.paddle().count, 1);
  EXPECT_GT(next.observed<BallState>(4).velocity[1], 0.0);
}

TEST_F(BallsTest, TheFirstContactWithTheBenchAfterThePaddleIsRecorded) {
  Inline robot(court());
  // a still paddle that faces the bench
  const std::array<double, 4> q{0.0, 0.9, 0.4, 0.0};
  pose_arm(robot, q);
  const Vector centre = vector(robot.burst(2).extended<Numbers>("paddle_position"));
  const Shot shot{centre + Vector{0, 0.1, 0}, {0, -4, 2}};
  for (int i = 0; i < 40; ++i) robot.ask("ball", shot.at(i));
  const Seen seen = robot.burst(600);

  const WatchedContacts paddle = seen.paddle();
  const SurfaceContacts bench = seen.bench();
  ASSERT_EQ(paddle.count, 1);
  ASSERT_GT(bench.iteration, paddle.iteration);
  EXPECT_GE(bench.count, 1);
  EXPECT_NEAR(bench.position[2], kBenchTop, 1e-6);
  EXPECT_GT(bench.position[1], 0.3);
  EXPECT_LT(bench.position[1], 2.7);
  EXPECT_GE(paddle.largest_speed, length(vector(paddle.velocity_after)));
  EXPECT_LT(paddle.largest_speed, 10);
}

TEST_F(BallsTest, AMovingPaddleIsRecordedWithItsVelocity) {
  Inline robot(court());
  const Shot shot = shot_at_the_paddle(robot);
  Numbers paddle_velocity{};
  Seen seen = robot.latest();
  for (int i = 0; i < 60 && seen.paddle().count == 0; ++i) {
    paddle_velocity = seen.extended<Numbers>("paddle_velocity");
    pose_arm(robot, {kPosture[0] + 0.004 * i, kPosture[1], kPosture[2], kPosture[3]}, {2, 0, 0, 0});
    robot.ask("ball", shot.at(i));
    seen = robot.burst(1);
  }

  ASSERT_EQ(seen.paddle().count, 1);
  EXPECT_GT(length(vector(paddle_velocity)), 1.0);
  // at the point of contact, which is up to a paddle's radius away from the centre
  EXPECT_LT(length(vector(seen.paddle().surface_velocity) - vector(paddle_velocity)),
            2 * 0.1 + 0.02);
  EXPECT_GT(seen.paddle().velocity_after[1], 0.78 * 4 * std::abs(seen.paddle().normal[1]) * 0.9);
}

TEST_F(BallsTest, APaddleThatIsTeleportedHitsNothingOnTheWay) {
  Inline robot(court({{"spin", "0,0,0"}}));
  pose_arm(robot, {-0.5, 1.2, 0.3, 0});
  const Vector left = vector(robot.burst(2).extended<Numbers>("paddle_position"));
  pose_arm(robot, {0.5, 1.2, 0.3, 0});
  const Vector right = vector(robot.burst(2).extended<Numbers>("paddle_position"));
  robot.ask("ball", BallState{numbers(0.5 * (left + right)), {}, {}});
  pose_arm(robot, {-0.5, 1.2, 0.3, 0});
  const Seen seen = robot.burst(1);

  EXPECT_EQ(seen.paddle().count, 0);
  EXPECT_GT(seen.paddle().smallest_distance, 0.05);
}

TEST_F(BallsTest, ABallThatIsTeleportedHitsNothingOnTheWay) {
  Inline robot(court());
  pose_arm(robot, kPosture);
  const Vector centre = vector(robot.burst(2).extended<Numbers>("paddle_position"));
  robot.ask("ball", BallState{numbers(centre + Vector{0, 0.5, 0}), {0, -1, 0}, {}});
  robot.ask("ball", BallState{numbers(centre - Vector{0, 0.5, 0}), {0, -1, 0}, {}});
  robot.burst(1);

  EXPECT_EQ(robot.burst(1).paddle().count, 0);
}

TEST_F(BallsTest, ClearingForgetsTheContactsAndLeavesTheArmAlone) {
  Inline robot(court({{"extra_balls", "1"}}));
  const Shot shot = shot_at_the_paddle(robot);
  for (const char* ball : {"ball", "ball_1"}) {
    for (int i = 0; i < 60; ++i) robot.ask(ball, shot.at(i));
  }
  const Seen hit = robot.burst(60);
  ASSERT_EQ(hit.paddle(0).count, 1);
  ASSERT_EQ(hit.paddle(1).count, 1);

  robot.request(ClearContacts{.ball = 2});
  const Seen one = robot.burst(1);
  EXPECT_EQ(one.paddle(0).count, 1);
  EXPECT_EQ(one.paddle(1).count, 0);
  EXPECT_EQ(one.paddle(1).iteration, -1);
  EXPECT_GT(one.paddle(1).smallest_distance, 0.0);
  EXPECT_LT(one.paddle(1).smallest_distance, 1.0);

  robot.request(ClearContacts{});
  const Seen all = robot.burst(1);
  EXPECT_EQ(all.paddle(0).count, 0);
  EXPECT_EQ(all.observed<JointState>(1).position, kPosture[1]);
  EXPECT_EQ(unpack<RowHead>(all.row.bytes()).fresh, 0u);

  robot.request(ClearContacts{.ball = 3});
  Batch batch = robot.frontend.pulse();
  robot.burst(1);
  EXPECT_THAT(batch.handle(0).text, HasSubstr("ball must be from 1 to 2, or 0 for all balls"));
}

TEST_F(BallsTest, TheOrderOfTheSurfacesChangesOnlyTheOrderOfTheirRecords) {
  Inline one(court());
  Inline other(court(
      {{"surfaces", "ground=0.7 0.7 0.75, fence=0.5 0.5 0.15, bench=0.7 0.7 0.92, paddle=0.78"}}));
  for (Inline* robot : {&one, &other}) {
    const Shot shot = shot_at_the_paddle(*robot);
    for (int i = 0; i < 60; ++i) robot->ask("ball", shot.at(i));
    robot->burst(600);
  }

  ASSERT_EQ(one.latest().paddle().count, 1);
  EXPECT_EQ(one.latest().observed<BallState>(4).position,
            other.latest().observed<BallState>(4).position);
  EXPECT_EQ(one.latest().paddle().velocity_after, other.latest().paddle().velocity_after);
  EXPECT_EQ(one.latest().bench().position, other.latest().bench().position);
}

TEST_F(BallsTest, WithoutAWatchedSurfaceTheFirstContactsAreRecorded) {
  Inline robot(court({{"surfaces", "bench=0.8"}, {"watched", ""}}));
  robot.ask("ball", BallState{{0.4, 1.0, 1.0}, {}, {}});
  const Seen seen = robot.burst(300);

  EXPECT_GE(seen.bench().count, 1);
  EXPECT_GT(seen.bench().iteration, 0);
  EXPECT_NEAR(seen.bench().position[2], kBenchTop, 1e-6);
}

TEST_F(BallsTest, WithoutSurfacesBallsFlyAndNoContactsArePublished) {
  Inline robot(court({{"surfaces", ""}, {"watched", ""}}));
  robot.ask("ball", BallState{{0.4, 1.0, 0.6}, {}, {}});
  const Seen seen = robot.burst(300);

  EXPECT_LT(seen.observed<BallState>(4).position[2], 0.0);
  EXPECT_THROW(seen.sensor("contacts"), std::out_of_range);
}

TEST_F(BallsTest, ExplainsOptionsThatCannotBe) {
  const auto start = [](const OptionValues& options) { return [=] { Inline robot(options); }; };
  EXPECT_THAT(start(court({{"balls", "elbow"}})),
              ThrowsMessage<Error>(HasSubstr("body 'elbow' is not a ball: its only joint must be a "
                                             "free joint")));
  EXPECT_THAT(start(court({{"balls", "bal"}})),
              ThrowsMessage<Error>(HasSubstr("no body 'bal'. Did you mean 'ball'?")));
  EXPECT_THAT(start(court({{"balls", ""}})),
              ThrowsMessage<Error>(HasSubstr("name the balls with balls=...")));
  EXPECT_THAT(start(court({{"surfaces", "bat"}, {"watched", ""}})),
              ThrowsMessage<Error>(AllOf(HasSubstr("no geom 'bat'"), HasSubstr("paddle"))));
}

TEST_F(BallsTest, RefusesNumbersOutOfTheirRange) {
  const auto start = [](const char* name, const char* text) {
    return [=] { Inline robot(court({{name, text}})); };
  };
  for (const char* option :
       {"air_density", "drag_coefficient", "lift_coefficient", "spin_decay", "teleport_distance"}) {
    for (const char* text : {"-1", "nan", "inf"}) {
      EXPECT_THAT(start(option, text),
                  ThrowsMessage<Error>(
                      HasSubstr(std::string(option) + " must be finite and not negative")));
    }
  }
  EXPECT_THAT(start("spin", "0,nan,0"), ThrowsMessage<Error>(HasSubstr("three finite numbers")));
  EXPECT_THAT(start("extra_balls", "100000"),
              ThrowsMessage<Error>(HasSubstr("extra_balls must be at most 1000, got 100000")));
}

}  // namespace
}  // namespace o80::mujoco
