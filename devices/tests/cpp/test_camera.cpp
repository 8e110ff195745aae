#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "vision/camera.hpp"

namespace o80::vision {
namespace {

using testing::DoubleNear;

Camera camera_with_lens() {
  Camera camera{.distortion = {-0.2, 0.08, 0.001, -0.002, -0.01}, .translation = {{0.1, -0.2, 3}}};
  camera.prepare();
  return camera;
}

TEST(Camera, SeesAPointStraightAheadAtItsCentre) {
  Camera camera;
  camera.prepare();
  const std::optional<Projection> seen = camera.project({{0, 0, 2}});

  ASSERT_TRUE(seen);
  EXPECT_DOUBLE_EQ(seen->pixel.x, 319.5);
  EXPECT_DOUBLE_EQ(seen->pixel.y, 239.5);
  EXPECT_DOUBLE_EQ(seen->depth, 2);
}

TEST(Camera, DirectionUndoesProjectionOverTheWholeImage) {
  const Camera camera = camera_with_lens();
  for (double x = -0.5; x < 640; x += 53) {
    for (double y = -0.5; y < 480; y += 37) {
      const std::optional<Vector> direction = camera.direction({x, y});
      ASSERT_TRUE(direction) << x << ", " << y;
      const std::optional<Projection> seen = camera.project(camera.place() + 2.5 * *direction);
      ASSERT_TRUE(seen);
      EXPECT_THAT(seen->pixel.x, DoubleNear(x, 1e-6));
      EXPECT_THAT(seen->pixel.y, DoubleNear(y, 1e-6));
    }
  }
}

TEST(Camera, SlopeIsThatOfTheProjection) {
  const Camera camera = camera_with_lens();
  const Vector point{{0.7, 0.4, -0.3}};
  const Projection seen = *camera.project(point);
  constexpr double kReach = 1e-6;
  for (std::size_t j = 0; j < 3; ++j) {
    Vector beyond = point;
    Vector before = point;
    beyond[j] += kReach;
    before[j] -= kReach;
    const Pixel a = camera.project(before)->pixel;
    const Pixel b = camera.project(beyond)->pixel;
    EXPECT_THAT(seen.slope(0, j), DoubleNear((b.x - a.x) / (2 * kReach), 1e-4));
    EXPECT_THAT(seen.slope(1, j), DoubleNear((b.y - a.y) / (2 * kReach), 1e-4));
  }
}

TEST(Camera, DoesNotSeeBehindItselfNorWhatTheLensWouldFoldBack) {
  Camera camera{.distortion = {-0.3, 0, 0, 0, 0}};
  camera.prepare();

  EXPECT_FALSE(camera.project({{0, 0, -1}}));
  EXPECT_FALSE(camera.project({{0, 0, 0}}));
  EXPECT_TRUE(camera.project({{1.0, 0, 1}}));
  EXPECT_FALSE(camera.project({{1.2, 0, 1}}));  // would lie further inside than the point before
}

}  // namespace
}  // namespace o80::vision
