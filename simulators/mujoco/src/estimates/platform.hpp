#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "balls/bounce.hpp"

namespace o80::mujoco {

/// Level resting rectangle on which balls bounce.
struct Platform {
  double height = 0;            // of the centre of a touching ball [m]
  std::array<double, 2> low{};  // least x and y [m]
  std::array<double, 2> high{};
  Restitution restitution{1, 1, 1};
  double friction = kNoSliding;
  Sphere sphere{};

  /// Whether the platform is below a point.
  bool carries(const Vector& point) const noexcept {
    return point.x >= low[0] && point.x <= high[0] && point.y >= low[1] && point.y <= high[1];
  }
};

/// Bounces a ball on the platform from above, whatever its velocity.
inline Ball bounced(Ball ball, const Platform& platform) noexcept {
  ball.velocity.z = -std::abs(ball.velocity.z);
  constexpr Directions kUpwards{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}};
  return bounced(ball, {}, kUpwards, platform.restitution, platform.friction, platform.sphere);
}

}  // namespace o80::mujoco
