#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "control/record.hpp"

namespace o80 {

/// The highest ticket of a purge, for each actuator. Commands with lower tickets end as purged,
/// even if they are taken later (ARCHITECTURE.md, Express batches and purges).
///
/// Realtime: everything but construction.
class PurgeTickets {
 public:
  PurgeTickets(std::uint32_t lanes, std::uint32_t actuators)
      : one_(actuators), own_all_(lanes), own_one_(std::size_t{lanes} * actuators) {}

  /// Stores the ticket of a purge of one actuator or of all.
  void raise(std::uint32_t actuator, std::uint64_t ticket) noexcept {
    std::uint64_t& highest = actuator == kEveryActuator ? all_ : one_[actuator];
    highest = std::max(highest, ticket);
  }
  /// The same for a purge of the commands of one lane.
  void raise_own(std::uint32_t lane, std::uint32_t actuator, std::uint64_t ticket) noexcept {
    std::uint64_t& highest =
        actuator == kEveryActuator ? own_all_[lane] : own_one_[lane * one_.size() + actuator];
    highest = std::max(highest, ticket);
  }
  /// True if a stored purge ends a command of this lane with this ticket.
  bool cover(std::uint32_t lane, std::uint32_t actuator, std::uint64_t ticket) const noexcept {
    return ticket < all_ || ticket < one_[actuator] || ticket < own_all_[lane] ||
           ticket < own_one_[lane * one_.size() + actuator];
  }
  /// Forgets all purges, because tickets start again from 0.
  void forget() noexcept {
    all_ = 0;
    for (auto* tickets : {&one_, &own_all_, &own_one_}) std::ranges::fill(*tickets, 0);
  }

 private:
  std::uint64_t all_ = 0;
  std::vector<std::uint64_t> one_;
  std::vector<std::uint64_t> own_all_;
  std::vector<std::uint64_t> own_one_;
};

}  // namespace o80
