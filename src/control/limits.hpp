#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "control/record.hpp"
#include "control/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Refuses a command that a robot cannot follow, when it is added and not later.
///
/// Each verb throws InvalidArgument, whose text names the actuator, the field, the value and what
/// is allowed. The schema must outlive it. `mask` is empty (the whole state) or a bit a number.
class CommandCheck {
 public:
  explicit CommandCheck(const Schema& schema);

  /// Index of an actuator by its name.
  std::uint32_t actuator(std::string_view name) const;
  /// The index itself, if there is such an actuator.
  std::uint32_t actuator(std::int64_t index) const;
  /// Words of a mask of its numbers.
  std::uint32_t words_of_mask(std::uint32_t actuator) const;
  /// Targets, one state after the other.
  void targets(std::uint32_t actuator, std::span<const std::byte> states,
               std::span<const std::uint64_t> mask = {}) const;
  /// A direct target: in real time, without a watchdog, no number may be kept away from its rest.
  void direct(std::uint32_t actuator, std::span<const std::byte> state,
              std::span<const std::uint64_t> mask = {}) const;
  /// A pace of so much of the first number that is commanded [1/s].
  void speed(std::uint32_t actuator, double speed, std::span<const std::uint64_t> mask = {}) const;
  /// The fastest way: what is commanded has limits of speed and acceleration.
  void fastest(std::uint32_t actuator, std::span<const std::uint64_t> mask = {}) const;
  /// That of a command that names none.
  Profile profile(std::uint32_t actuator) const;
  /// A request's struct: its booleans and enumerations are ones.
  void request(std::uint32_t index, std::span<const std::byte> payload) const;

 private:
  struct Range {
    double lowest;  // finite: what has no limit cannot be infinite either
    double highest;
  };

  bool within(std::uint32_t actuator, const std::byte* state,
              const std::uint64_t* mask) const noexcept;
  [[noreturn]] void refuse(std::uint32_t actuator, const std::byte* state,
                           const std::uint64_t* mask) const;

  const Schema& schema_;
  std::vector<std::optional<StateLayout>> layouts_;
  std::vector<Range> ranges_;  // one for each limit of the schema
};

}  // namespace o80
