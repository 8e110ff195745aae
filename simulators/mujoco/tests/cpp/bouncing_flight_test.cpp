#include "balls/bouncing_flight.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "balls/contact_record.hpp"
#include "expect_near.hpp"

namespace o80::mujoco {
namespace {

constexpr double kRadius = 0.02;
constexpr double kHollow = 2.0 / 3.0;  // moment of inertia / (mass radius^2)
constexpr double kStep = 0.002;
constexpr double kThickness = 0.0027;  // half
const Air kWeightless{0, 0, 0, {0, 0, 0}};

/// A watched paddle that looks along y and moves from one pose to another.
Surface paddle(const Pose& from, const Pose& to, const Restitution& kept = {0.78, 0.78, 0.78}) {
  return {.shape = Plate{{0.07425, kThickness, 0.0941}, 1},
          .restitution = kept,
          .watched = true,
          .motion = {from, to}};
}
Surface still_paddle(const Restitution& kept = {0.78, 0.78, 0.78}) { return paddle({}, {}, kept); }
/// Its top is at z = 0.775.
Surface bench() {
  const Pose pose{.position = {0.4, 1.57, 0.755}};
  return {.shape = Box{{0.7625, 1.37, 0.02}},
          .restitution = {0.70, 0.70, 0.92},
          .motion = {pose, pose}};
}

struct Flight {
  Ball end;
  WatchedContacts paddle;
  std::array<SurfaceContacts, 2> others;
};
/// One step of free flight among surfaces.
Flight step(const Ball& ball, std::vector<Surface> surfaces, const Air& air = kWeightless) {
  Flight flight;
  const ContactRecords records{{&flight.paddle, 1}, flight.others};
  flight.end = flown_among(
      surfaces, ball, air, {kRadius, kHollow}, kStep, 0,
      [&](const Contact& contact, const Ball& before, const Ball& after) {
        records.add({.iteration = 7}, contact, before, after);
      },
      [&](const Surface& surface, double gap) { records.add_gap(surface, gap); });
  return flight;
}

TEST(BouncingFlight, HeadOnTurnsTheNormalVelocityRoundAndFliesTheRestOfTheStep) {
  // touches after a quarter of the step
  const double gap = 5.0 * kStep / 4;
  const Flight flight =
      step({{0, gap + kThickness + kRadius, 0}, {0, -5, 0}, {}}, {still_paddle()});

  EXPECT_EQ(flight.paddle.count, 1);
  EXPECT_EQ(flight.paddle.iteration, 7);
  EXPECT_NEAR(flight.paddle.fraction, 0.25, 1e-6);
  expect_near(vector(flight.paddle.position), {0, kThickness, 0});
  expect_near(vector(flight.paddle.normal), {0, 1, 0});
  expect_near(flight.end.velocity, {0, 0.78 * 5, 0});
  expect_near(flight.end.position, {0, kThickness + kRadius + 0.75 * kStep * 3.9, 0}, 2e-9);
}

TEST(BouncingFlight, GlancingKeepsItsShareOfTheTangentialVelocity) {
  const Flight flight =
      step({{-0.005, 0.0237, 0.002}, {4, -2, 1}, {}}, {still_paddle({0.6, 0.7, 0.8})});

  ASSERT_EQ(flight.paddle.count, 1);
  // the axes after y are z and x
  expect_near(vector(flight.paddle.velocity_after), {0.7 * 4, 0.8 * 2, 0.6 * 1});
}

TEST(BouncingFlight, CountsVelocitiesRelativeToAMovingPaddle) {
  const Vector swing{0, 3, 0};
  const Pose from{.position = {0, -0.003, 0}, .velocity = swing};
  const Pose to{.position = {0, 0.003, 0}, .velocity = swing};
  const Flight flight = step({{0, 0.03, 0}, {0, -5, 0}, {}}, {paddle(from, to)});

  ASSERT_EQ(flight.paddle.count, 1);
  EXPECT_NEAR(flight.end.velocity.y, 3 + 0.78 * 8, 1e-9);
  expect_near(vector(flight.paddle.surface_velocity), swing);
  EXPECT_NEAR(flight.paddle.largest_speed, 9.24, 1e-9);
}

TEST(BouncingFlight, IsHitByAPaddleThatComesFromBehind) {
  const Vector swing{0, 10, 0};
  const Pose from{.position = {0, -0.01, 0}, .velocity = swing};
  const Pose to{.position = {0, 0.01, 0}, .velocity = swing};
  const Flight flight = step({{0, 0.02, 0}, {0, 1, 0}, {}}, {paddle(from, to)});

  ASSERT_EQ(flight.paddle.count, 1);
  EXPECT_NEAR(flight.end.velocity.y, 10 + 0.78 * 9, 1e-9);
}

TEST(BouncingFlight, AddsTheRotationOfThePaddleAtTheHitPoint) {
  // turns about z, the hit point 50 mm away from the axis
  const Vector spin{0, 0, 20};
  Pose from{.spin = spin};
  Pose to{.spin = spin};
  const double angle = 20 * kStep;
  to.rotation.m = {
      std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
  const Flight flight = step({{0.05, 0.0247, 0}, {0, -1, 0}, {}}, {paddle(from, to)});

  ASSERT_EQ(flight.paddle.count, 1);
  const Vector point = vector(flight.paddle.position);
  expect_near(vector(flight.paddle.surface_velocity), cross(spin, point));
  EXPECT_NEAR(flight.paddle.surface_velocity[1], 1.0, 0.02);
  // the face has turned too, by as much as had passed of the step
  const double turned = angle * flight.paddle.fraction;
  expect_near(vector(flight.paddle.normal), {-std::sin(turned), std::cos(turned), 0}, 1e-9);
  EXPECT_GT(flight.end.velocity.y, 0.5);
}

TEST(BouncingFlight, ATurnAloneSweepsTheBallAway) {
  Pose from{.spin = {0, 0, 100}};
  Pose to = from;
  const double angle = 100 * kStep;
  to.rotation.m = {
      std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
  const Flight flight = step({{0.06, 0.025, 0}, {}, {}}, {paddle(from, to)});

  EXPECT_EQ(flight.paddle.count, 1);
  EXPECT_GT(flight.end.velocity.y, 100 * 0.06);
}

TEST(BouncingFlight, MissesBesideTheEdgeAndSaysHowNarrowly) {
  const Ball beside{{0.07425 + kRadius + kThickness + 0.001, 0.003, 0}, {0, -3, 0}, {}};
  const Flight flight = step(beside, {still_paddle()});

  EXPECT_EQ(flight.paddle.count, 0);
  expect_near(flight.end.velocity, beside.velocity);
  EXPECT_NEAR(flight.paddle.smallest_distance, 0.001, 1e-5);
}

TEST(BouncingFlight, AtTheRimPushesTheBallSideways) {
  const Flight flight = step({{0.07425 + 0.01, 0.022, 0}, {0, -3, 0}, {}}, {still_paddle()});

  ASSERT_EQ(flight.paddle.count, 1);
  EXPECT_GT(flight.end.velocity.x, 0.5);
  EXPECT_GT(flight.paddle.normal[0], 0.3);
  EXPECT_NEAR(length(vector(flight.paddle.normal)), 1, 1e-12);
}

TEST(BouncingFlight, NoBallPassesThroughThePaddleHoweverFastEitherIs) {
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
    const Flight flight = step({{0, gap, 0}, {0, -ball, 0}, {}}, {paddle(from, to)});
    ASSERT_GE(flight.paddle.count, 1) << "at " << ball << " m/s";
    ASSERT_GT(flight.end.position.y, to.position.y) << "at " << ball << " m/s";
  }
}

TEST(BouncingFlight, NoFastBallSlipsPastAPaddleThatTurns) {
  Pose from{.spin = {50, 0, 0}};
  Pose to = from;
  const double angle = 50 * kStep;
  to.rotation.m = {
      1, 0, 0, 0, std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle)};
  for (double z = -0.09; z < 0.09; z += 0.005) {
    const Flight flight = step({{0, 0.1, z}, {0, -100, 0}, {}}, {paddle(from, to)});
    EXPECT_GE(flight.paddle.count, 1) << "z = " << z;
  }
}

TEST(BouncingFlight, OnABoxKeepsTheSharesOfItsRestitution) {
  const Flight flight = step({{0.3, 1.0, 0.797}, {1, -4, -2}, {}}, {bench()});

  EXPECT_EQ(flight.others[0].count, 1);
  EXPECT_EQ(flight.paddle.count, 0);
  EXPECT_EQ(flight.others[0].iteration, -1);  // the ball has not met the watched surface before
  expect_near(flight.end.velocity, {0.70, -0.70 * 4, 0.92 * 2});
  // three quarters of the way down, the rest up again
  EXPECT_NEAR(flight.end.position.z, 0.795 + 0.92 * 2 * (kStep - 0.001), 1e-8);
}

/// A bounce on the bench of a ball that comes along -y.
Ball off_the_bench(double speed, double spin, const Restitution& kept, double friction) {
  Surface surface = bench();
  surface.restitution = kept;
  surface.friction = friction;
  return step({{0.3, 1.0, 0.797}, {0, -speed, -2}, {spin, 0, 0}}, {surface}).end;
}

TEST(BouncingFlight, AGrippedBallExchangesVelocityAndSpin) {
  // what friction takes from the velocity it gives to the spin: m r dv = I d(omega)
  for (const double spin : {-150.0, 0.0, 60.0, 150.0, 300.0}) {
    const Ball end = off_the_bench(4, spin, {0.55, 0.55, 0.9}, kNoSliding);
    const double slip = -4 + kRadius * spin;
    EXPECT_NEAR(end.velocity.y, -4 - 0.45 * slip, 1e-9) << spin;
    EXPECT_NEAR(end.spin.x, spin - 0.45 * slip / (kHollow * kRadius), 1e-6) << spin;
    EXPECT_NEAR(end.spin.y, 0, 1e-9);
    EXPECT_NEAR(end.spin.z, 0, 1e-9);
  }
}

TEST(BouncingFlight, ABallThatKeepsThreeFifthsRollsAndARollingOneGoesOn) {
  const Ball rolls = off_the_bench(4, 20, {0.6, 0.6, 0.9}, kNoSliding);
  EXPECT_NEAR(rolls.velocity.y + kRadius * rolls.spin.x, 0, 1e-9);

  const Ball goes_on = off_the_bench(4, 4 / kRadius, {0.6, 0.6, 0.9}, 0.25);
  EXPECT_NEAR(goes_on.velocity.y, -4, 1e-9);
  EXPECT_NEAR(goes_on.spin.x, 4 / kRadius, 1e-6);
}

TEST(BouncingFlight, ASlidingBallLosesWhatFrictionAllows) {
  const Ball slides = off_the_bench(6, -100, {0.55, 0.55, 0.9}, 0.25);
  const double taken = 0.25 * (1 + 0.9) * 2;
  EXPECT_NEAR(slides.velocity.y, -6 + taken, 1e-9);
  EXPECT_NEAR(slides.spin.x, -100 + taken / (kHollow * kRadius), 1e-6);

  const Ball frictionless = off_the_bench(6, -100, {0.55, 0.55, 0.9}, 0);
  EXPECT_EQ(frictionless.velocity.y, -6);
  EXPECT_EQ(frictionless.spin.x, -100);
}

TEST(BouncingFlight, SideSpinAloneCarriesTheBallSideways) {
  Surface surface = bench();
  surface.friction = 0.25;
  const Ball end = step({{0.3, 1.0, 0.797}, {0, 0, -2}, {0, 80, 0}}, {surface}).end;
  EXPECT_GT(end.velocity.x, 0.3);
  EXPECT_LT(end.spin.y, 80);
  // spin about the normal stays
  const Ball drilling = step({{0.3, 1.0, 0.797}, {0, -1, -2}, {0, 0, 70}}, {surface}).end;
  EXPECT_NEAR(drilling.spin.z, 70, 1e-9);
}

TEST(BouncingFlight, NeverAddsEnergyOnAStillSurfaceWithAnySpin) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> velocity(-8, 8);
  std::uniform_real_distribution<double> spin(-500, 500);
  std::uniform_real_distribution<double> share(0, 1);
  const auto energy = [](const Ball& ball) {
    return dot(ball.velocity, ball.velocity) +
           kHollow * kRadius * kRadius * dot(ball.spin, ball.spin);
  };
  for (int n = 0; n < 5000; ++n) {
    Surface surface = bench();
    surface.restitution = {share(random), share(random), share(random)};
    if (n % 2 == 0) surface.friction = share(random);
    const Ball before{{0.3, 1.0, 0.7951},
                      {velocity(random), velocity(random), -1 - std::abs(velocity(random))},
                      {spin(random), spin(random), spin(random)}};
    const Ball after = step(before, {surface}).end;
    ASSERT_LE(energy(after), energy(before) + 2 * kSlowestRebound * kSlowestRebound)
        << before.velocity.x << ' ' << before.velocity.y << ' ' << before.velocity.z;
  }
}

TEST(BouncingFlight, NeverAddsEnergyOnAStillSurface) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> velocity(-8, 8);
  std::uniform_real_distribution<double> side(-0.09, 0.09);
  int hits = 0;
  for (int n = 0; n < 2000; ++n) {
    const Ball ball{{side(random), 0.024, side(random)},
                    {velocity(random), -std::abs(velocity(random)), velocity(random)},
                    {}};
    const Flight flight = step(ball, {still_paddle()});
    if (flight.paddle.count == 0) continue;
    ++hits;
    const Vector before = vector(flight.paddle.velocity_before);
    const double approach = -dot(before, vector(flight.paddle.normal));
    if (0.78 * approach < kSlowestRebound) continue;
    EXPECT_LT(length(flight.end.velocity), length(before));
  }
  EXPECT_GT(hits, 500);
}

TEST(BouncingFlight, ABallHopsOnABoxAndComesNearlyToRest) {
  const Air air{0, 0, 0, {0, 0, -9.81}};
  Ball ball{{0.4, 1.57, 1.0}, {}, {}};
  std::int64_t bounces = 0;
  double lowest = 1;
  for (int i = 0; i < 20000; ++i) {
    const Flight flight = step(ball, {bench()}, air);
    ball = flight.end;
    bounces += flight.others[0].count;
    lowest = std::min(lowest, ball.position.z);
  }
  EXPECT_GT(bounces, 100);
  EXPECT_GT(lowest, 0.795 - 1e-5);
  EXPECT_LT(ball.position.z, 0.796);
}

TEST(BouncingFlight, ABallWedgedBetweenTwoSurfacesComesToNoEnd) {
  Surface above = still_paddle();
  above.motion = {Pose{.position = {0, 0.0227 * 2, 0}}, Pose{.position = {0, 0.0227 * 2, 0}}};
  const Flight flight = step({{0, 0.0227, 0}, {0, -100, 0}, {}}, {still_paddle(), above});

  EXPECT_EQ(flight.paddle.count, kMaxBounces);
  EXPECT_NEAR(flight.end.position.y, 0.0227, 1e-6);
}

TEST(BouncingFlight, SeveralImpactsFitIntoOneStep) {
  Surface wall = bench();
  wall.record = 1;
  const Pose pose{.position = {0.4, 1.57, 0.755 + 0.04 + 0.05}};
  wall.motion = {pose, pose};
  // 10 mm of room at 30 m/s, of which each bounce leaves 92 %
  const Flight flight = step({{0.4, 1.57, 0.80}, {0, 0, -30}, {}}, {bench(), wall});

  EXPECT_GE(flight.others[0].count + flight.others[1].count, 4);
  EXPECT_GE(flight.end.position.z, 0.795 - 1e-9);
  EXPECT_LE(flight.end.position.z, 0.805 + 1e-9);
}

}  // namespace
}  // namespace o80::mujoco
