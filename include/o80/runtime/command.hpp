#pragma once

#include <chrono>
#include <cstdint>

#include "o80/control/record.hpp"

namespace o80 {

/// How to get to a target: made by direct(), duration(), speed(), until() or iterations().
struct PaceSpec {
  Pace pace = Pace::direct;
  std::int64_t amount = 0;
  double per_second = 0;
};

/// At once, in one iteration.
constexpr PaceSpec direct() { return {}; }
constexpr PaceSpec duration(std::chrono::nanoseconds time) {
  return {Pace::duration, time.count(), 0};
}
/// Peak speed of the first number of the state, in its unit [1/s].
constexpr PaceSpec speed(double per_second) { return {Pace::speed, 0, per_second}; }
/// There at this iteration.
constexpr PaceSpec until(Iteration iteration) { return {Pace::until, iteration, 0}; }
/// So many iterations (of a trajectory: for each of its rows).
constexpr PaceSpec iterations(std::int64_t count) { return {Pace::iterations, count, 0}; }

/// Everything about a command but its actuator and its target.
struct CommandOptions {
  PaceSpec pace = {};
  Mode mode = Mode::queue;
  Profile profile = Profile::linear;
  Start start = Start::desired;
};

/// When a batch is to be taken, and what if that moment has passed.
struct PulseOptions {
  enum class Late : std::uint8_t { reject, now };
  Iteration at = kNow;
  Late late = Late::reject;
};

}  // namespace o80
