#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "control/batch/record.hpp"

namespace o80 {

/// The highest ticket of a purge, for each lane and actuator. Commands with lower tickets end as
/// purged, even if they are taken later (src/control/README.md#order).
///
/// Realtime: everything but construction.
class PurgeTickets {
 public:
  static constexpr std::uint32_t kEveryLane = 0xFFFFFFFF;

  PurgeTickets(std::uint32_t lanes, std::uint32_t actuators)
      : lanes_(lanes),
        actuators_(actuators),
        highest_((lanes + 1) * (std::size_t{actuators} + 1)) {}

  /// Stores the ticket of a purge: of one lane or kEveryLane, of one actuator or kEveryActuator.
  void raise(std::uint32_t lane, std::uint32_t actuator, std::uint64_t ticket) noexcept {
    std::uint64_t& highest = highest_[index(lane, actuator)];
    highest = std::max(highest, ticket);
  }
  /// True if a stored purge ends a command of this lane with this ticket.
  bool cover(std::uint32_t lane, std::uint32_t actuator, std::uint64_t ticket) const noexcept {
    return ticket < highest_[index(kEveryLane, kEveryActuator)] ||
           ticket < highest_[index(kEveryLane, actuator)] ||
           ticket < highest_[index(lane, kEveryActuator)] ||
           ticket < highest_[index(lane, actuator)];
  }
  /// Forgets all purges, because tickets start again from 0.
  void forget() noexcept { std::ranges::fill(highest_, 0); }

 private:
  /// The last row and the last column are those of every lane and of every actuator.
  std::size_t index(std::uint32_t lane, std::uint32_t actuator) const noexcept {
    return std::min(lane, lanes_) * (std::size_t{actuators_} + 1) + std::min(actuator, actuators_);
  }

  std::uint32_t lanes_;
  std::uint32_t actuators_;
  std::vector<std::uint64_t> highest_;
};

}  // namespace o80
