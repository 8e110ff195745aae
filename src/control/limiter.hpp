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

/// What a limit did to a state.
struct Limited {
  Limit limit = Limit::none;
  std::uint32_t number = 0;  // of the state, the first one that was held back

  /// As a status carries it.
  std::uint8_t packed() const noexcept {
    return static_cast<std::uint8_t>(static_cast<std::uint32_t>(limit) | (number < 31 ? number : 31)
                                                                             << 3);
  }
};

/// Keeps the desired state of one actuator within its limits, last of all, and brings it to rest.
///
/// Its numbers keep position, speed and acceleration of their own; the published state is their
/// rounding, inward at the bounds.
///
/// Realtime: everything but construction.
class Limiter {
 public:
  Limiter(const Schema& schema, const ActuatorRow& actuator, const StateLayout& layout);

  /// Something is limited or rests.
  bool any() const noexcept { return !numbers_.empty(); }
  /// At rest in this state.
  void restart(const std::byte* state) noexcept;
  /// A motion begins where the state is now.
  void begin() noexcept;

  /// What a motion asks of the numbers of `mask` (null: all) => what the limits admit, for one
  /// iteration; the others come to rest, resting ones where they rest. One number catches up no
  /// faster than `most`.
  Limited follow(const Motion& motion, std::byte* state, const std::uint64_t* mask,
                 std::uint32_t one, double most) noexcept;
  /// One iteration towards rest; resting numbers go where they rest, unless they are held. True
  /// while anything moves.
  bool brake(std::byte* state) noexcept;
  /// The same where the others are what was observed, which is in `state`.
  bool brake_resting(std::byte* state) noexcept;
  /// Resting numbers of `mask` (null: all) stay where they are until `release`.
  void hold(const std::uint64_t* mask) noexcept;
  void release() noexcept;
  /// Some number is held away from where it rests.
  bool holds() const noexcept {
    return std::ranges::any_of(numbers_, [](const Number& each) {
      return each.held && each.limiter.position() != *each.rest;
    });
  }
  /// Braking would move nothing.
  bool at_rest() const noexcept {
    return std::ranges::all_of(numbers_, [](const Number& each) { return each.at_rest(); });
  }
  /// The same of resting numbers.
  bool resting_at_rest() const noexcept {
    return std::ranges::all_of(
        numbers_, [](const Number& each) { return !each.rest.has_value() || each.at_rest(); });
  }
  /// Tells a motion how the numbers move that lag behind it ...
  void keep_lagging(Motion& motion, const std::byte* state) const noexcept;
  /// ... or that move without any motion, and where all of them are.
  void hand_over(Motion& motion, const std::byte* state) const noexcept;

  /// Plans the fastest motion to `target` for the numbers of `mask` (null: all), ending together;
  /// its iterations.
  std::int64_t plan_fastest(const std::byte* target, const std::uint64_t* mask) noexcept;
  /// The same, taking so many instead.
  void stretch_fastest(std::int64_t iterations) noexcept;
  /// One iteration of it.
  Limited follow_fastest(std::byte* state) noexcept;

 private:
  struct Number {
    std::uint32_t number;
    NumberLimiter limiter;
    std::optional<double> rest;
    FastestMotion fastest;
    bool planned = false;  // part of the fastest motion
    bool held = false;     // stays away from where it rests

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
