#pragma once

#include <gtest/gtest.h>

#include "balls/vector.hpp"

namespace o80::mujoco {

/// Each component is as near as that.
inline void expect_near(const Vector& a, const Vector& b, double tolerance = 1e-9) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}

}  // namespace o80::mujoco
