#include "balls/shape.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "expect_near.hpp"

namespace o80::mujoco {
namespace {

const Plate kPlate{{0.07425, 0.0027, 0.0941}, 1};

TEST(Plate, IsFlatInsideItsRimAndLooksAlongItsThinAxis) {
  const Near above = kPlate.near({0.03, 0.05, -0.06});
  EXPECT_NEAR(above.distance, 0.05 - 0.0027, 1e-15);
  expect_near(above.normal, {0, 1, 0}, 1e-15);
  expect_near(kPlate.near({0.03, -0.05, -0.06}).normal, {0, -1, 0}, 1e-15);
}

TEST(Plate, IsAsFarFromAPointBesideItAsItsRim) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> draw(-0.3, 0.3);
  for (int n = 0; n < 300; ++n) {
    const Vector point{draw(random), draw(random), draw(random)};
    if (std::pow(point.x / 0.07425, 2) + std::pow(point.z / 0.0941, 2) < 1) continue;
    // the rim by brute force
    double smallest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 20000; ++i) {
      const double angle = 2 * std::numbers::pi * i / 20000;
      const Vector rim{0.07425 * std::cos(angle), 0, 0.0941 * std::sin(angle)};
      smallest = std::min(smallest, length(point - rim));
    }
    const Near near = kPlate.near(point);
    EXPECT_NEAR(near.distance, smallest - 0.0027, 1e-7);
    EXPECT_NEAR(length(near.normal), 1, 1e-12);
    // one distance along the normal leads onto the surface
    EXPECT_NEAR(kPlate.near(point - near.distance * near.normal).distance, 0, 1e-9);
  }
}

TEST(Plate, HasNoJumpAtItsRim) {
  const Near in = kPlate.near({0.07425 - 1e-9, 0.01, 0});
  const Near out = kPlate.near({0.07425 + 1e-9, 0.01, 0});
  EXPECT_NEAR(in.distance, out.distance, 1e-12);
  expect_near(in.normal, out.normal, 1e-6);
}

TEST(Plate, TakesItsThinAxisFromWhereverItIs) {
  EXPECT_NEAR((Plate{{0.1, 0.2, 0.003}, 2}.near({0.05, 0.1, 0.5}).distance), 0.497, 1e-15);
  EXPECT_NEAR((Plate{{0.003, 0.1, 0.2}, 0}.near({-0.5, 0.05, 0.1}).distance), 0.497, 1e-15);
}

TEST(Box, GivesDistancesToFacesEdgesAndCorners) {
  const Box box{{1, 2, 3}};
  EXPECT_NEAR(box.near({0, 0, 3.5}).distance, 0.5, 1e-15);
  EXPECT_NEAR(box.near({4, 6, 3}).distance, 5, 1e-15);
  expect_near(box.near({4, -6, 0}).normal, {0.6, -0.8, 0}, 1e-15);
  EXPECT_NEAR(box.near({2, 3, 4}).distance, std::sqrt(3), 1e-15);
}

TEST(Box, LeadsOutThroughItsNearestFace) {
  const Box box{{1, 2, 3}};
  EXPECT_NEAR(box.near({-0.9, 0, 0}).distance, -0.1, 1e-15);
  expect_near(box.near({-0.9, 0, 0}).normal, {-1, 0, 0}, 0);
  expect_near(box.near({0, 0, 2.8}).normal, {0, 0, 1}, 0);
}

}  // namespace
}  // namespace o80::mujoco
