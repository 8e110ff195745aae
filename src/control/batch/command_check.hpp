#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "control/batch/record.hpp"
#include "control/motion/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Profile of a command that names none: minimum_jerk for an actuator with acceleration limits.
Profile usual_profile(const Schema& schema, const ActuatorRow& actuator) noexcept;

/// What the targets of each actuator may be: for the check of a command on both sides of a lane.
///
/// Realtime: everything but construction.
class TargetLimits {
 public:
  /// The layouts must outlive it.
  TargetLimits(const Schema& schema, const Layouts& layouts);

  std::size_t actuators() const noexcept { return actuators_.size(); }
  const StateLayout& layout(std::uint32_t actuator) const noexcept {
    return *actuators_[actuator].layout;
  }
  /// True if the numbers whose bits are set are finite and inside their bounds, or proper.
  bool admit(std::uint32_t actuator, const std::byte* state,
             const std::uint64_t* mask) const noexcept;
  /// Puts the finite numbers whose bits are set inside their bounds; returns how many were outside.
  std::size_t clip(std::uint32_t actuator, std::byte* state,
                   const std::uint64_t* mask) const noexcept;
  /// The first number whose bit is set, and that moves without a limit of acceleration.
  std::uint32_t first_without_acceleration(std::uint32_t actuator,
                                           const std::uint64_t* mask) const noexcept {
    const auto& ranges = actuators_[actuator].ranges;
    for (std::uint32_t i = 0; i < ranges.size(); ++i) {
      if (masked(mask, i) && !ranges[i].accelerates) return i;
    }
    return StateLayout::kNoNumber;
  }

 private:
  struct Range {
    double lowest;  // finite: an infinite target is refused even without a limit
    double highest;
    bool accelerates;  // true also if the number switches
  };
  struct Actuator {
    const StateLayout* layout;
    std::vector<Range> ranges;  // of its numbers
  };
  std::vector<Actuator> actuators_;
};

/// Checks a command when it is added to a batch.
///
/// Each function throws InvalidArgument with the actuator, the field, the value and the allowed
/// values. The schema must outlive it. `mask` is empty (all numbers) or has a bit for each number.
class CommandCheck {
 public:
  explicit CommandCheck(const Schema& schema)
      : schema_(schema), layouts_(layouts_of_types(schema, false)), targets_(schema, layouts_) {}
  CommandCheck(const CommandCheck&) = delete;

  /// Index of an actuator by its name.
  std::uint32_t actuator(std::string_view name) const;
  /// The same index, if there is such an actuator.
  std::uint32_t actuator(std::int64_t index) const;
  const StateLayout& layout(std::uint32_t actuator) const { return targets_.layout(actuator); }
  /// Number of 64-bit words of a mask for this actuator.
  std::size_t words_of_mask(std::uint32_t actuator) const {
    return targets_.layout(actuator).mask_words();
  }
  /// Checks one or several targets, one state after the other.
  void targets(std::uint32_t actuator, std::span<const std::byte> states,
               std::span<const std::uint64_t> mask = {}) const;
  /// Puts the numbers of one or several targets inside their bounds; returns how many were outside.
  std::size_t clip(std::uint32_t actuator, std::span<std::byte> states,
                   std::span<const std::uint64_t> mask = {}) const noexcept {
    const std::size_t size = targets_.layout(actuator).size();
    std::size_t clipped = 0;
    for (; states.size() >= size; states = states.subspan(size)) {
      clipped += targets_.clip(actuator, states.data(), mask.empty() ? nullptr : mask.data());
    }
    return clipped;
  }
  /// True if targets() admits `steps` states for each of these actuators, one after the other.
  bool admits(std::span<const std::uint32_t> actuators, std::uint32_t steps,
              const std::byte* states) const noexcept {
    for (const std::uint32_t actuator : actuators) {
      const std::size_t size = targets_.layout(actuator).size();
      for (std::uint32_t step = 0; step < steps; ++step, states += size) {
        if (!targets_.admit(actuator, states, nullptr)) return false;
      }
    }
    return true;
  }
  /// Checks that a direct target keeps rest values, in real time without a watchdog.
  void direct(std::uint32_t actuator, std::span<const std::byte> state,
              std::span<const std::uint64_t> mask = {}) const;
  /// Checks the pace of a command: the speed of the first commanded number [1/s].
  void speed(std::uint32_t actuator, double speed, std::span<const std::uint64_t> mask = {}) const;
  /// Checks that all commanded numbers have limits of speed and acceleration.
  void fastest(std::uint32_t actuator, std::span<const std::uint64_t> mask = {}) const;
  Profile usual_profile(std::uint32_t actuator) const {
    return o80::usual_profile(schema_, schema_.actuators[actuator]);
  }
  /// Checks the struct of a request: booleans are 0 or 1, enumerations have a label.
  void request(std::uint32_t index, std::span<const std::byte> payload) const;

 private:
  [[noreturn]] void refuse_actuator(const std::string& which) const;
  [[noreturn]] void refuse(std::uint32_t actuator, const std::byte* state,
                           const std::uint64_t* mask) const;

  const Schema& schema_;
  Layouts layouts_;
  TargetLimits targets_;
};

}  // namespace o80
