#include "balls/ball_flight.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace o80::mujoco {
namespace {

const Air kVacuum{0, 0, 0, {0, 0, -9.81}};

Air room_air() { return Air::of(1.18, {0.40, 1.47}, 0.02, 0.0027, 0.5, {0, 0, -9.81}); }

Ball flown_for(Ball ball, const Air& air, double duration, double step) {
  for (int i = 0; i < std::lround(duration / step); ++i) ball = flown(ball, air, step);
  return ball;
}

TEST(BallFlight, IsAParabolaInVacuum) {
  const Ball end = flown_for({{0, 0, 1}, {1, 2, 3}, {}}, kVacuum, 0.5, 0.002);

  EXPECT_NEAR(end.position.x, 0.5, 1e-12);
  EXPECT_NEAR(end.position.z, 1 + 1.5 - 0.5 * 9.81 * 0.25, 1e-12);
  EXPECT_NEAR(end.velocity.z, 3 - 9.81 * 0.5, 1e-12);
}

TEST(BallFlight, SlowsDownAsDragSays) {
  Air air = room_air();
  air.gravity = {};
  const Ball end = flown_for({{}, {0, 10, 0}, {}}, air, 1.0, 0.002);

  // dv/dt = -k v^2 has the solution v = v0 / (1 + k v0 t)
  EXPECT_NEAR(end.velocity.y, 10 / (1 + air.drag * 10), 1e-9);
  EXPECT_NEAR(end.position.y, std::log(1 + air.drag * 10) / air.drag, 1e-9);
}

TEST(BallFlight, TopSpinPullsTheBallDown) {
  const Ball plain = flown_for({{}, {0, -5, 0}, {}}, room_air(), 0.3, 0.002);
  const Ball top = flown_for({{}, {0, -5, 0}, {30, 0, 0}}, room_air(), 0.3, 0.002);

  EXPECT_LT(top.position.z, plain.position.z - 0.03);
  EXPECT_NEAR(top.spin.x, 30 * std::exp(-0.5 * 0.3), 1e-9);
}

TEST(BallFlight, LiftSaturatesAsTheSpinGrows) {
  const Air linear = room_air();
  const Air saturating = Air::of(1.18, {0.40, 1.47, 4.0}, 0.02, 0.0027, 0.5, {0, 0, -9.81});
  const auto lift = [](const Air& air, double spin) {
    return acceleration(air, {0, -5, 0}, {0, 0, spin}).x;
  };

  EXPECT_EQ(lift(saturating, 0), 0);
  EXPECT_NEAR(lift(saturating, 0.01), lift(linear, 0.01), 1e-3 * lift(linear, 0.01));
  // r |omega| / |v| is 1/4: half the lift
  EXPECT_NEAR(lift(saturating, 62.5), 0.5 * lift(linear, 62.5), 1e-12);
  EXPECT_GT(lift(saturating, 1000), lift(saturating, 500));
  EXPECT_LT(lift(saturating, 1e9), 5 * linear.magnus / (4 * 0.02) * 5 + 1e-6);
  EXPECT_TRUE(std::isfinite(length(acceleration(saturating, {}, {0, 0, 50}))));
}

TEST(BallFlight, DoesNotDependOnTheStep) {
  const Ball ball{{}, {1, -5, 2}, {30, 10, -5}};
  const Ball fine = flown_for(ball, room_air(), 0.6, 0.0005);
  const Ball coarse = flown_for(ball, room_air(), 0.6, 0.01);

  EXPECT_LT(length(fine.position - coarse.position), 1e-5);
}

}  // namespace
}  // namespace o80::mujoco
