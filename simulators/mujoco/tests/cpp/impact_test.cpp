#include "balls/impact.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "balls/ball_record.hpp"
#include "expect_near.hpp"

namespace o80::mujoco {
namespace {

constexpr double kRadius = 0.02;
constexpr double kStep = 0.002;
constexpr double kThickness = 0.0027;  // half
const Air kWeightless{0, 0, 0, {0, 0, 0}};

/// A racket that looks along y, on its way from one pose to another.
Surface racket(const Pose& from, const Pose& to, const Restitution& kept = {0.78, 0.78, 0.78}) {
  return {SurfaceKind::racket, Blade{{0.07425, kThickness, 0.0941}, 1}, kept, {from, to}};
}
Surface resting_racket(const Restitution& kept = {0.78, 0.78, 0.78}) {
  return racket({}, {}, kept);
}
Surface table() {
  const Pose pose{.position = {0.4, 1.57, 0.755}};
  return {SurfaceKind::table, Box{{0.7625, 1.37, 0.02}}, {0.70, 0.70, 0.92}, {pose, pose}};
}

struct Flight {
  Ball end;
  BallRecord record;
};
/// One step of free flight among surfaces.
Flight step(const Ball& ball, std::vector<Surface> surfaces, const Air& air = kWeightless) {
  Flight flight;
  flight.end = flown_among(
      surfaces, ball, air, kRadius, kStep, 0,
      [&](const Surface& surface, const Touch& touch, const Ball& before, const Ball& after) {
        note(flight.record, {.iteration = 7}, surface, touch, before, after);
      },
      [&](const Surface& surface, double gap) { note_gap(flight.record, surface, gap); });
  return flight;
}

TEST(Impact, HeadOnTurnsTheNormalVelocityRoundAndFliesTheRestOfTheStep) {
  // touches after a quarter of the step
  const double gap = 5.0 * kStep / 4;
  const Flight flight =
      step({{0, gap + kThickness + kRadius, 0}, {0, -5, 0}, {}}, {resting_racket()});

  EXPECT_EQ(flight.record.count, 1u);
  EXPECT_EQ(flight.record.iteration, 7);
  EXPECT_NEAR(flight.record.fraction, 0.25, 1e-6);
  expect_near(vector(flight.record.position), {0, kThickness, 0});
  expect_near(vector(flight.record.normal), {0, 1, 0});
  expect_near(flight.end.velocity, {0, 0.78 * 5, 0});
  expect_near(flight.end.position, {0, kThickness + kRadius + 0.75 * kStep * 3.9, 0}, 2e-9);
}

TEST(Impact, GlancingKeepsItsShareOfTheTangentialVelocity) {
  const Flight flight =
      step({{-0.005, 0.0237, 0.002}, {4, -2, 1}, {}}, {resting_racket({0.6, 0.7, 0.8})});

  ASSERT_EQ(flight.record.count, 1u);
  // the axes after y are z and x
  expect_near(vector(flight.record.velocity_after), {0.7 * 4, 0.8 * 2, 0.6 * 1});
}

TEST(Impact, CountsVelocitiesRelativeToAMovingRacket) {
  const Vector swing{0, 3, 0};
  const Pose from{.position = {0, -0.003, 0}, .velocity = swing};
  const Pose to{.position = {0, 0.003, 0}, .velocity = swing};
  const Flight flight = step({{0, 0.03, 0}, {0, -5, 0}, {}}, {racket(from, to)});

  ASSERT_EQ(flight.record.count, 1u);
  EXPECT_NEAR(flight.end.velocity.y, 3 + 0.78 * 8, 1e-9);
  expect_near(vector(flight.record.racket_velocity), swing);
  EXPECT_NEAR(flight.record.largest_speed, 9.24, 1e-9);
}

TEST(Impact, IsHitByARacketThatComesFromBehind) {
  const Vector swing{0, 10, 0};
  const Pose from{.position = {0, -0.01, 0}, .velocity = swing};
  const Pose to{.position = {0, 0.01, 0}, .velocity = swing};
  const Flight flight = step({{0, 0.02, 0}, {0, 1, 0}, {}}, {racket(from, to)});

  ASSERT_EQ(flight.record.count, 1u);
  EXPECT_NEAR(flight.end.velocity.y, 10 + 0.78 * 9, 1e-9);
}

TEST(Impact, AddsTheRotationOfTheRacketAtTheHitPoint) {
  // turns about z, the hit point 50 mm away from the axis
  const Vector spin{0, 0, 20};
  Pose from{.spin = spin};
  Pose to{.spin = spin};
  const double angle = 20 * kStep;
  to.rotation.m = {
      std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
  const Flight flight = step({{0.05, 0.0247, 0}, {0, -1, 0}, {}}, {racket(from, to)});

  ASSERT_EQ(flight.record.count, 1u);
  const Vector point = vector(flight.record.position);
  expect_near(vector(flight.record.racket_velocity), cross(spin, point));
  EXPECT_NEAR(flight.record.racket_velocity[1], 1.0, 0.02);
  // the face has turned too, by as much as had passed of the step
  const double turned = angle * flight.record.fraction;
  expect_near(vector(flight.record.normal), {-std::sin(turned), std::cos(turned), 0}, 1e-9);
  EXPECT_GT(flight.end.velocity.y, 0.5);
}

TEST(Impact, ATurnAloneSweepsTheBallAway) {
  Pose from{.spin = {0, 0, 100}};
  Pose to = from;
  const double angle = 100 * kStep;
  to.rotation.m = {
      std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
  const Flight flight = step({{0.06, 0.025, 0}, {}, {}}, {racket(from, to)});

  EXPECT_EQ(flight.record.count, 1u);
  EXPECT_GT(flight.end.velocity.y, 100 * 0.06);
}

TEST(Impact, MissesBesideTheEdgeAndSaysHowNarrowly) {
  const Ball beside{{0.07425 + kRadius + kThickness + 0.001, 0.003, 0}, {0, -3, 0}, {}};
  const Flight flight = step(beside, {resting_racket()});

  EXPECT_EQ(flight.record.count, 0u);
  expect_near(flight.end.velocity, beside.velocity);
  EXPECT_NEAR(flight.record.smallest_distance, 0.001, 1e-5);
}

TEST(Impact, AtTheRimPushesTheBallSideways) {
  const Flight flight = step({{0.07425 + 0.01, 0.022, 0}, {0, -3, 0}, {}}, {resting_racket()});

  ASSERT_EQ(flight.record.count, 1u);
  EXPECT_GT(flight.end.velocity.x, 0.5);
  EXPECT_GT(flight.record.normal[0], 0.3);
  EXPECT_NEAR(length(vector(flight.record.normal)), 1, 1e-12);
}

TEST(Impact, NoBallPassesThroughTheRacketHoweverFastEitherIs) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> where(-0.04, 0.04);
  std::uniform_real_distribution<double> speed(20, 300);
  std::uniform_real_distribution<double> start(0.0, 1.0);
  for (int n = 0; n < 3000; ++n) {
    const double ball = n % 3 == 0 ? 100.0 : speed(random);
    const double swing = n % 2 == 0 ? 0.0 : 20.0;
    const double way = (ball + swing) * kStep;
    const Pose from{.position = {where(random), 0, where(random)}, .velocity = {0, swing, 0}};
    Pose to = from;
    to.position.y = swing * kStep;
    // somewhere on the way through the blade
    const double gap = kRadius + kThickness + start(random) * way * 0.999;
    const Flight flight = step({{0, gap, 0}, {0, -ball, 0}, {}}, {racket(from, to)});
    ASSERT_GE(flight.record.count, 1u) << "at " << ball << " m/s";
    ASSERT_GT(flight.end.position.y, to.position.y) << "at " << ball << " m/s";
  }
}

TEST(Impact, NoFastBallSlipsPastARacketThatTurns) {
  Pose from{.spin = {50, 0, 0}};
  Pose to = from;
  const double angle = 50 * kStep;
  to.rotation.m = {
      1, 0, 0, 0, std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle)};
  for (double z = -0.09; z < 0.09; z += 0.005) {
    const Flight flight = step({{0, 0.1, z}, {0, -100, 0}, {}}, {racket(from, to)});
    EXPECT_GE(flight.record.count, 1u) << "z = " << z;
  }
}

TEST(Impact, OnTheTableKeepsTheSharesOfItsRestitution) {
  const Flight flight = step({{0.3, 1.0, 0.797}, {1, -4, -2}, {}}, {table()});

  EXPECT_EQ(flight.record.table_count, 1u);
  EXPECT_EQ(flight.record.count, 0u);
  EXPECT_EQ(flight.record.landing_iteration, -1);  // a bounce before the hit is no landing
  expect_near(flight.end.velocity, {0.70, -0.70 * 4, 0.92 * 2});
  // three quarters of the way down, the rest up again
  EXPECT_NEAR(flight.end.position.z, 0.795 + 0.92 * 2 * (kStep - 0.001), 1e-8);
}

TEST(Impact, BouncesAsTheFlightModelOfTheExperimentDoes) {
  // flight.predict((0.46, 2.95, 1.37), (0.24, -4.14, 2.28), 1.0, spin=(30, 0, 0)) of the
  // application, which bounces once
  const Air air = Air::of(1.18, 0.40, 1.47, 0.02, 0.0027, 0.5, {0, 0, -9.81});
  Ball ball{{0.46, 2.95, 1.37}, {0.24, -4.14, 2.28}, {30, 0, 0}};
  std::uint32_t bounces = 0;
  for (int i = 0; i < 500; ++i) {
    const Flight flight = step(ball, {table()}, air);
    ball = flight.end;
    bounces += flight.record.table_count;
  }
  EXPECT_EQ(bounces, 1u);
  expect_near(ball.position, {0.63421394, -0.05990447, 1.33619891}, 1e-4);
  expect_near(ball.velocity, {0.11350646, -1.97961788, -0.68067597}, 1e-3);
}

TEST(Impact, NeverAddsEnergyOnAStillSurface) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> velocity(-8, 8);
  std::uniform_real_distribution<double> side(-0.09, 0.09);
  int hits = 0;
  for (int n = 0; n < 2000; ++n) {
    const Ball ball{{side(random), 0.024, side(random)},
                    {velocity(random), -std::abs(velocity(random)), velocity(random)},
                    {}};
    const Flight flight = step(ball, {resting_racket()});
    if (flight.record.count == 0) continue;
    ++hits;
    const Vector before = vector(flight.record.velocity_before);
    const double approach = -dot(before, vector(flight.record.normal));
    if (0.78 * approach < kSlowestRebound) continue;
    EXPECT_LT(length(flight.end.velocity), length(before));
  }
  EXPECT_GT(hits, 500);
}

TEST(Impact, ABallHopsOnTheTableAndComesToNearlyRest) {
  const Air air{0, 0, 0, {0, 0, -9.81}};
  Ball ball{{0.4, 1.57, 1.0}, {}, {}};
  std::uint32_t bounces = 0;
  double lowest = 1;
  for (int i = 0; i < 20000; ++i) {
    const Flight flight = step(ball, {table()}, air);
    ball = flight.end;
    bounces += flight.record.table_count;
    lowest = std::min(lowest, ball.position.z);
  }
  EXPECT_GT(bounces, 100u);
  EXPECT_GT(lowest, 0.795 - 1e-5);
  EXPECT_LT(ball.position.z, 0.796);
}

TEST(Impact, ABallWedgedBetweenTwoSurfacesComesToNoEnd) {
  Surface above = resting_racket();
  above.motion = {Pose{.position = {0, 0.0227 * 2, 0}}, Pose{.position = {0, 0.0227 * 2, 0}}};
  const Flight flight = step({{0, 0.0227, 0}, {0, -100, 0}, {}}, {resting_racket(), above});

  EXPECT_EQ(flight.record.count, static_cast<std::uint32_t>(kMostImpacts));
  EXPECT_NEAR(flight.end.position.y, 0.0227, 1e-6);
}

TEST(Impact, SeveralImpactsFitIntoOneStep) {
  Surface wall = table();
  wall.kind = SurfaceKind::floor;
  const Pose pose{.position = {0.4, 1.57, 0.755 + 0.04 + 0.05}};
  wall.motion = {pose, pose};
  // 10 mm of room at 30 m/s, of which each bounce leaves 92 %
  const Flight flight = step({{0.4, 1.57, 0.80}, {0, 0, -30}, {}}, {table(), wall});

  EXPECT_GE(flight.record.table_count + flight.record.floor_count, 4u);
  EXPECT_GE(flight.end.position.z, 0.795 - 1e-9);
  EXPECT_LE(flight.end.position.z, 0.805 + 1e-9);
}

TEST(Impact, TheFirstTableContactAfterAHitIsTheLanding) {
  BallRecord record;
  const Ball ball{{}, {0, 3, 4}, {}};
  const Touch touch{.share = 0.5, .point = {0.1, 2.2, 0.775}, .normal = {0, 0, 1}};
  note(record, {.iteration = 3}, table(), touch, ball, ball);
  note(record, {.iteration = 10}, resting_racket(), touch, ball, ball);
  note(record, {.iteration = 90}, table(), touch, ball, ball);
  note(record, {.iteration = 95}, table(), touch, ball, ball);

  EXPECT_EQ(record.table_count, 3u);
  EXPECT_EQ(record.iteration, 10);
  EXPECT_EQ(record.landing_iteration, 90);
  EXPECT_EQ(record.landing_position, numbers(touch.point));
  EXPECT_EQ(record.largest_speed, 5);
  EXPECT_EQ(record.smallest_distance, 0);
}

}  // namespace
}  // namespace o80::mujoco
