// Balls of the driver: imposed, replayed, hit, put elsewhere.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "table_tennis_scene.hpp"

namespace o80::mujoco {
namespace {

using testing::DoubleNear;
using testing::HasSubstr;
using testing::Pointwise;

using MujocoBallsTest = MujocoDriverTest;

TEST_F(MujocoBallsTest, ABallIsImposedWhileCommandedAndFliesOnAfterwards) {
  Inline twin(table_tennis());
  const Shot shot{{0.2, 1.0, 1.2}, {0.5, 2, 1}};
  for (int i = 0; i < 10; ++i) twin.ask("ball", shot.at(i));
  const Seen last = twin.burst(10);
  EXPECT_EQ(last.observed<BallState>(4).position, shot.at(9).position);
  EXPECT_EQ(last.observed<BallState>(4).velocity, shot.at(9).velocity);
  EXPECT_TRUE(last.row.active(4));

  const Seen free = twin.burst(1);
  EXPECT_FALSE(free.row.active(4));
  const Ball before{vector(shot.at(9).position), vector(shot.at(9).velocity), {30, 0, 0}};
  const Air air = Air::of(1.18, 0.40, 1.47, 0.02, 0.0027, 0.5, {0, 0, -9.81});
  const Ball after = flown(before, air, 0.002);
  EXPECT_THAT(free.observed<BallState>(4).position,
              Pointwise(DoubleNear(1e-15), numbers(after.position)));
  EXPECT_THAT(free.observed<BallState>(4).velocity,
              Pointwise(DoubleNear(1e-15), numbers(after.velocity)));
}

TEST_F(MujocoBallsTest, ABounceOfAReplayedBallIsPartOfTheReplay) {
  Inline twin(table_tennis());
  twin.ask("ball", Shot{{0.4, 1.0, 0.81}, {0, -2, -10}}.at(0));
  for (int i = 0; i < 5; ++i) twin.ask("ball", Shot{{0.4, 1.0, 0.81}, {0, -2, -10}}.at(i));
  const Seen inside = twin.burst(6);

  EXPECT_LT(inside.observed<BallState>(4).position[2], 0.775);
  EXPECT_EQ(inside.record().table_count, 0u);
}

TEST_F(MujocoBallsTest, AHitEndsTheReplayInThatVeryIteration) {
  Inline twin(table_tennis());
  const Shot shot = shot_at_the_racket(twin);
  for (int i = 0; i < 60; ++i) twin.ask("ball", shot.at(i));
  Batch batch = twin.frontend.pulse();
  Seen seen = twin.burst(1);
  int i = 0;
  while (seen.record().count == 0 && ++i < 60) {
    EXPECT_EQ(seen.observed<BallState>(4).position, shot.at(i - 1).position);
    seen = twin.burst(1);
  }

  const BallRecord record = seen.record();
  ASSERT_EQ(record.count, 1u);
  EXPECT_EQ(record.iteration, seen.row.iteration());
  EXPECT_GT(record.fraction, 0.0);
  EXPECT_LT(record.fraction, 1.0);
  EXPECT_EQ(record.smallest_distance, 0.0);
  EXPECT_EQ(record.velocity_before, numbers(shot.velocity));
  EXPECT_EQ(record.racket_velocity, (Numbers{}));
  // turned round along the normal, and kept by its share
  EXPECT_THAT(
      record.velocity_after,
      Pointwise(DoubleNear(1e-12),
                numbers(0.78 * (shot.velocity - 2 * dot(shot.velocity, vector(record.normal)) *
                                                    vector(record.normal)))));
  // the rest of the iteration was flown with it
  const Vector moved = vector(seen.observed<BallState>(4).position) - vector(record.position);
  const Vector expected = 0.02 * vector(record.normal) +
                          (0.002 * (1 - record.fraction)) * vector(record.velocity_after);
  EXPECT_THAT(numbers(moved), Pointwise(DoubleNear(5e-5), numbers(expected)));

  // all commands behind the one of this iteration ended as interrupted, in this iteration
  EXPECT_EQ(batch.handle(static_cast<std::size_t>(i)).status, Status::completed);
  for (const std::size_t n : {static_cast<std::size_t>(i + 1), std::size_t{59}}) {
    EXPECT_EQ(batch.handle(n).status, Status::interrupted);
    EXPECT_EQ(batch.handle(n).iteration, seen.row.iteration());
  }

  // and the ball flies freely from now on
  const Seen next = twin.burst(1);
  EXPECT_FALSE(next.row.active(4));
  EXPECT_EQ(next.record().count, 1u);
  EXPECT_GT(next.observed<BallState>(4).velocity[1], 0.0);
}

TEST_F(MujocoBallsTest, AReturnLandsOnTheTableAndIsRecorded) {
  Inline twin(table_tennis());
  // a still racket, its face towards the opponent
  const std::array<double, 4> q{0.0, 0.9, 0.4, 0.0};
  pose_arm(twin, q);
  const Vector racket = vector(twin.burst(2).extended<Numbers>("racket_position"));
  const Shot shot{racket + Vector{0, 0.1, 0}, {0, -4, 2}};
  pose_arm(twin, q);
  for (int i = 0; i < 40; ++i) twin.ask("ball", shot.at(i));
  const Seen seen = twin.burst(600);

  const BallRecord record = seen.record();
  ASSERT_EQ(record.count, 1u);
  ASSERT_GT(record.landing_iteration, record.iteration);
  EXPECT_GE(record.table_count, 1u);
  EXPECT_NEAR(record.landing_position[2], 0.775, 1e-6);
  EXPECT_GT(record.landing_position[1], 0.2);
  EXPECT_LT(record.landing_position[1], 2.94);
  EXPECT_GE(record.largest_speed, length(vector(record.velocity_after)));
  EXPECT_LT(record.largest_speed, 10);
}

TEST_F(MujocoBallsTest, ARacketThatIsPutElsewhereHitsNothingOnTheWay) {
  Inline twin(table_tennis({{"spin", "0,0,0"}}));
  pose_arm(twin, {-0.5, 1.2, 0.3, 0});
  const Vector left = vector(twin.burst(2).extended<Numbers>("racket_position"));
  pose_arm(twin, {0.5, 1.2, 0.3, 0});
  const Vector right = vector(twin.burst(2).extended<Numbers>("racket_position"));
  twin.ask("ball", BallState{numbers(0.5 * (left + right)), {}});
  pose_arm(twin, {-0.5, 1.2, 0.3, 0});
  const Seen seen = twin.burst(1);

  EXPECT_EQ(seen.record().count, 0u);
  EXPECT_GT(seen.record().smallest_distance, 0.05);
}

TEST_F(MujocoBallsTest, ABallThatIsPutElsewhereHitsNothingOnTheWay) {
  Inline twin(table_tennis());
  pose_arm(twin, kPosture);
  const Vector racket = vector(twin.burst(2).extended<Numbers>("racket_position"));
  twin.ask("ball", BallState{numbers(racket + Vector{0, 0.5, 0}), {0, -1, 0}});
  twin.ask("ball", BallState{numbers(racket - Vector{0, 0.5, 0}), {0, -1, 0}});
  twin.burst(1);

  EXPECT_EQ(twin.burst(1).record().count, 0u);
}

TEST_F(MujocoBallsTest, ClearingForgetsTheContactsAndLeavesTheArmAlone) {
  Inline twin(table_tennis({{"extra_balls", "1"}}));
  const Shot shot = shot_at_the_racket(twin);
  for (int i = 0; i < 60; ++i) twin.ask("ball", shot.at(i));
  for (int i = 0; i < 60; ++i) twin.ask("ball_1", shot.at(i));
  const Seen hit = twin.burst(60);
  ASSERT_EQ(hit.record(0).count, 1u);
  ASSERT_EQ(hit.record(1).count, 1u);

  twin.request(ClearContacts{.ball = 2});
  const Seen one = twin.burst(1);
  EXPECT_EQ(one.record(0).count, 1u);
  EXPECT_EQ(one.record(1).count, 0u);
  EXPECT_EQ(one.record(1).iteration, -1);
  EXPECT_GT(one.record(1).smallest_distance, 0.0);
  EXPECT_LT(one.record(1).smallest_distance, 1.0);

  twin.request(ClearContacts{});
  const Seen all = twin.burst(1);
  EXPECT_EQ(all.record(0).count, 0u);
  EXPECT_EQ(all.observed<JointState>(1).position, kPosture[1]);
  EXPECT_EQ(unpack<RowHead>(all.row.bytes()).fresh, 0u);

  twin.request(ClearContacts{.ball = 3});
  Batch batch = twin.frontend.pulse();
  twin.burst(1);
  EXPECT_THAT(batch.handle(0).text, HasSubstr("there are 2 balls"));
}

}  // namespace
}  // namespace o80::mujoco
