#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "balls/vector.hpp"
#include "o80/describe/describe.hpp"

namespace o80::mujoco {

/// Flies a ball to the end of its flight within one iteration. The ball bounces off surfaces that
/// are part of the world, by the same laws and in the same steps as in ordinary iterations; moving
/// surfaces are ignored.
struct FlyOut {
  static constexpr std::string_view kHelp = "fly a ball to its next bounce within one iteration";
  std::uint32_t ball = 1;
  std::uint32_t every = 1;
  std::uint32_t most = 5000;
  std::array<double, 3> low{-1e9, -1e9, -1e9};
  std::array<double, 3> high{1e9, 1e9, 1e9};
};
O80_DESCRIBE(FlyOut, (ball, "which, counted from 1; no command may move it"),
             (every, "iterations; whenever so many have passed, a bounce or being outside ends it"),
             (most, "iterations of flight, however it goes"),
             (low, "the ball is outside below one of these [m]"),
             (high, "the ball is outside above one of these [m]"));

inline constexpr std::uint32_t kMaxFlownOut = 100'000;  // limit of the iterations

/// True outside the box of a request.
inline bool outside(const FlyOut& request, const Vector& position) noexcept {
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    if (position[axis] < request.low[i] || position[axis] > request.high[i]) return true;
  }
  return false;
}

}  // namespace o80::mujoco
