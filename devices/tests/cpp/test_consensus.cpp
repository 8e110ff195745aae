#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "vision/consensus.hpp"

namespace o80::vision {
namespace {

using testing::DoubleNear;

/// A camera at a place, which looks along a horizontal direction.
Camera camera_at(const Vector& place, double ahead_x, double ahead_y) {
  Camera camera;
  // x right, y down, z ahead
  camera.rotation = {{ahead_y, -ahead_x, 0, 0, 0, -1, ahead_x, ahead_y, 0}};
  camera.translation = -1.0 * (camera.rotation * place);
  camera.prepare();
  return camera;
}

class Consensus : public testing::Test {
 protected:
  std::vector<Camera> cameras_{camera_at({{0, -3, 1}}, 0, 1), camera_at({{3, 0, 1.5}}, -1, 0),
                               camera_at({{0, 3, 1.2}}, 0, -1), camera_at({{-3, 0, 0.8}}, 1, 0)};
  Vector ball_{{0.2, -0.1, 1.1}};

  Sighting seen(int camera, const Vector& point, double dx = 0, double dy = 0) const {
    const Projection p = *cameras_[static_cast<std::size_t>(camera)].project(point);
    return {camera, {p.pixel.x + dx, p.pixel.y + dy}, 0};
  }
  std::vector<Sighting> by_all() const {
    return {seen(0, ball_), seen(1, ball_), seen(2, ball_), seen(3, ball_)};
  }
};

TEST_F(Consensus, FindsThePointThatAllCamerasSee) {
  const std::optional<Located> found = locate(cameras_, by_all(), {});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->count, 4);
  EXPECT_EQ(found->cameras, 0b1111U);
  EXPECT_THAT(length(found->point - ball_), DoubleNear(0, 1e-6));
  EXPECT_THAT(found->residual, DoubleNear(0, 1e-3));
}

TEST_F(Consensus, AFalseSightingInAnyCameraIsLeftOut) {
  for (std::size_t wrong = 0; wrong < 4; ++wrong) {
    std::vector<Sighting> sightings = by_all();
    sightings[wrong].pixel.x += 60;
    const std::optional<Located> found = locate(cameras_, sightings, {});
    ASSERT_TRUE(found);
    EXPECT_EQ(found->cameras, 0b1111U & ~(1U << wrong));
    EXPECT_THAT(length(found->point - ball_), DoubleNear(0, 1e-6));
  }
}

TEST_F(Consensus, ASecondSightingInEveryCameraDoesNoHarm) {
  std::vector<Sighting> sightings;
  for (int i = 0; i < 4; ++i) {
    sightings.push_back(seen(i, ball_, 40.0 * (i + 1), -25.0 * i));
    sightings.push_back(seen(i, ball_));
  }
  const std::optional<Located> found = locate(cameras_, sightings, {});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->count, 4);
  EXPECT_THAT(length(found->point - ball_), DoubleNear(0, 1e-6));
}

TEST_F(Consensus, WhatHasNotTheSizeOfABallIsLeftOut) {
  std::vector<Sighting> sightings = by_all();
  for (Sighting& each : sightings) each.area = 50;
  EXPECT_EQ(locate(cameras_, sightings, {})->count, 4);
  sightings[1].area = 4000;
  EXPECT_EQ(locate(cameras_, sightings, {})->cameras, 0b1101U);
}

TEST_F(Consensus, NeedsAsManyCamerasAsAsked) {
  const std::vector<Sighting> two{seen(0, ball_), seen(1, ball_)};
  EXPECT_TRUE(locate(cameras_, two, {.least = 2}));
  EXPECT_FALSE(locate(cameras_, two, {.least = 3}));
  EXPECT_FALSE(locate(cameras_, std::vector<Sighting>{seen(0, ball_)}, {}));
  EXPECT_FALSE(locate(cameras_, {}, {}));
}

TEST_F(Consensus, OfEquallyManyCamerasThoseNearerToTheExpectedPlaceWin) {
  // cameras 0 and 1 see the ball, cameras 2 and 3 something else, a little more exactly
  const Vector other{{-0.3, 0.2, 1.0}};
  const std::vector<Sighting> sightings{seen(0, ball_, 0, 0.2), seen(1, ball_, 0, -0.2),
                                        seen(2, other), seen(3, other)};
  EXPECT_EQ(locate(cameras_, sightings, {})->cameras, 0b1100U);
  EXPECT_EQ(locate(cameras_, sightings, {.expected = ball_})->cameras, 0b0011U);
}

TEST_F(Consensus, CovarianceIsThatOfTheErrors) {
  // errors of a pixel in each direction, many times => the spread of the point
  const ConsensusRule rule{.tolerance = 8, .noise = 1};
  Matrix<3, 3> squares;
  Matrix<3, 3> said;
  int count = 0;
  for (int turn = 0; turn < 256; ++turn) {
    std::vector<Sighting> sightings;
    for (int i = 0; i < 4; ++i) {
      const double dx = (turn >> (2 * i)) & 1 ? 1 : -1;
      const double dy = (turn >> (2 * i + 1)) & 1 ? 1 : -1;
      sightings.push_back(seen(i, ball_, dx, dy));
    }
    const std::optional<Located> found = locate(cameras_, sightings, rule);
    ASSERT_TRUE(found);
    const Vector error = found->point - ball_;
    squares = squares + error * transposed(error);
    said = found->covariance;
    ++count;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_THAT(squares(i, i) / count / said(i, i), DoubleNear(1, 0.05));
  }
}

}  // namespace
}  // namespace o80::vision
