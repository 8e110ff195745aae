#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "control/fastest_motion.hpp"
#include "control/motion.hpp"
#include "control/number_limiter.hpp"
#include "control/state_layout.hpp"

namespace o80 {

/// The limit that changed a state, if any.
struct Limited {
  Limit limit = Limit::none;
  std::uint32_t number = 0;  // the first number of the state that it changed

  /// As the detail of a status: the limit in 3 bits, the number (at most 31) above.
  std::uint8_t packed() const noexcept {
    return static_cast<std::uint8_t>(static_cast<std::uint32_t>(limit) | (number < 31 ? number : 31)
                                                                             << 3);
  }
};

/// Applied after interpolation: keeps the desired state of one actuator within its limits, and
/// brakes it to rest.
///
/// For each number it keeps position, speed and acceleration as double. The published state is
/// their rounding, inward at the bounds.
///
/// Realtime: everything but construction.
class Limiter {
 public:
  Limiter(const Schema& schema, const ActuatorRow& actuator, const StateLayout& layout);

  /// True if a number has a limit or a rest value.
  bool any() const noexcept { return !numbers_.empty(); }
  /// Sets all numbers to this state, at rest.
  void restart(const std::byte* state) noexcept;
  /// A motion begins at the present state.
  void begin() noexcept;

  /// One iteration: follows the motion with the numbers of `mask` (null: all), as far as the limits
  /// allow. The other numbers brake, those with a rest value to that value. `one`: the number whose
  /// command has a speed; it catches up at most at `most` [1/iteration].
  Limited follow(const Motion& motion, std::byte* state, const std::uint64_t* mask,
                 std::uint32_t one, double most) noexcept;
  /// The same for a target that is to be reached in this iteration; `state` holds it.
  Limited follow(std::byte* state) noexcept;
  /// One iteration of braking. Numbers with a rest value go to it, unless they are held. True while
  /// a number moves.
  bool brake(std::byte* state) noexcept;
  /// The same, but only for numbers with a rest value; the others follow `state`, the observed one.
  bool brake_resting(std::byte* state) noexcept;
  /// Holds the numbers of `mask` (null: all) that have a rest value where they are, until
  /// release().
  void hold(const std::uint64_t* mask) noexcept;
  void release() noexcept;
  /// True if a number is held away from its rest value.
  bool holds() const noexcept {
    return std::ranges::any_of(numbers_, [](const Number& each) {
      return each.held && each.limiter.position() != *each.rest;
    });
  }
  /// True if braking would change nothing.
  bool at_rest() const noexcept {
    return std::ranges::all_of(numbers_, [](const Number& each) { return each.at_rest(); });
  }
  /// The same, for numbers with a rest value.
  bool resting_at_rest() const noexcept {
    return std::ranges::all_of(
        numbers_, [](const Number& each) { return !each.rest.has_value() || each.at_rest(); });
  }
  /// Passes to a motion the speeds of the numbers that lag behind it, for the command that
  /// overwrites it.
  void keep_lagging(Motion& motion, const std::byte* state) const noexcept;
  /// Passes to a new motion the exact positions of all numbers, and the speeds of those that move.
  void hand_over(Motion& motion, const std::byte* state) const noexcept;

  /// Plans the fastest motion to `target` for the numbers of `mask` (null: all), which end
  /// together. Returns its number of iterations.
  std::int64_t plan_fastest(const std::byte* target, const std::uint64_t* mask) noexcept;
  /// Stretches the planned motion to `iterations`.
  void stretch_fastest(std::int64_t iterations) noexcept;
  /// One iteration of the planned motion.
  Limited follow_fastest(std::byte* state) noexcept;

 private:
  struct Number {
    std::uint32_t number;
    NumberLimiter limiter;
    std::optional<double> rest;
    FastestMotion fastest;
    double lowest;         // range of its kind
    double highest;        //
    std::uint32_t offset;  // in the state [bytes]
    bool is_double;        // the state has exactly its position
    bool planned = false;  // part of the fastest motion
    bool held = false;     // does not go to its rest value

    bool away() const noexcept { return rest && !held && limiter.position() != *rest; }
    bool at_rest() const noexcept { return limiter.at_rest() && !away(); }
    bool brake() noexcept;
  };
  void publish(const Number& number, std::byte* state) const noexcept;
  void leave_out(Number& number, std::byte* state) noexcept;
  void keep_moving(Motion& motion, const std::byte* state, const Number& number) const noexcept;

  const StateLayout& layout_;
  std::vector<Number> numbers_;
};

}  // namespace o80
