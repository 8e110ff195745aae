#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <vector>

#include "estimates/platform.hpp"

namespace o80::mujoco {

/// Node of a predicted flight. A bounce gives two nodes of the same time, before and after.
struct Node {
  double time = 0;  // since the start [s]
  Ball ball{};
  bool bounced = false;  // the ball has just left the platform
};

inline constexpr std::size_t kMaxNodes = 1'000'000;
inline constexpr double kShortestStep = 1e-9;  // a shorter remainder of a flight is omitted [s]
inline constexpr double kShortestRise = 0.05;  // [s^2/m]: a rising ball is above its start
                                               // for at least this times its velocity

/// Finds the time within a step at which a falling ball touches the platform [s], if any.
inline std::optional<double> touch_within(const Ball& ball, const Air& air,
                                          const Platform& platform, double step) noexcept {
  const auto above = [&](double time) {
    return flown(ball, air, time).position.z >= platform.height;
  };
  double low = std::min(step, std::max(0.0, kShortestRise * ball.velocity.z));
  double high = step;
  if (!above(low) || above(high)) return std::nullopt;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (above(middle) ? low : high) = middle;
  }
  if (!platform.carries(flown(ball, air, high).position)) return std::nullopt;
  return high;
}

/// Predicts the flight of a ball in steps [s], with bounces on a platform, if any; the last node is
/// at `duration` [s]. Throws std::length_error for more than `kMaxNodes`.
inline std::vector<Node> predicted_flight(Ball ball, const Air& air, const Platform* platform,
                                          double duration, double step) {
  std::vector<Node> nodes{{0, ball, false}};
  for (double now = 0; duration - now > kShortestStep;) {
    const double longest = std::min(step, duration - now);
    const std::optional<double> touch =
        platform != nullptr ? touch_within(ball, air, *platform, longest) : std::nullopt;
    ball = flown(ball, air, touch.value_or(longest));
    now += touch.value_or(longest);
    nodes.push_back({now, ball, false});
    if (nodes.size() >= kMaxNodes) {
      throw std::length_error("the flight has more than a million steps and bounces");
    }
    if (!touch) continue;
    ball = bounced(ball, *platform);
    nodes.push_back({now, ball, true});
  }
  return nodes;
}

}  // namespace o80::mujoco
