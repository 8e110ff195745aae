#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "control/record.hpp"

namespace o80 {

/// The highest ticket of a purge, for each actuator: commands with lower tickets end as purged,
/// however much later they come to be taken.
///
/// Realtime: everything but construction.
class PurgeTickets {
 public:
  PurgeTickets(std::uint32_t lanes, std::uint32_t actuators)
      : one_(actuators), own_all_(lanes), own_one_(std::size_t{lanes} * actuators) {}

  /// A purge was taken, of an actuator or of every one.
  void raise(std::uint32_t actuator, std::uint64_t ticket) noexcept {
    std::uint64_t& highest = actuator == kEveryActuator ? all_ : one_[actuator];
    highest = std::max(highest, ticket);
  }
  /// The same for a purge of what one lane sent.
  void raise_own(std::uint32_t lane, std::uint32_t actuator, std::uint64_t ticket) noexcept {
    std::uint64_t& highest =
        actuator == kEveryActuator ? own_all_[lane] : own_one_[lane * one_.size() + actuator];
    highest = std::max(highest, ticket);
  }
  /// Whether a purge has ended a command of this lane with this ticket.
  bool cover(std::uint32_t lane, std::uint32_t actuator, std::uint64_t ticket) const noexcept {
    return ticket < all_ || ticket < one_[actuator] || ticket < own_all_[lane] ||
           ticket < own_one_[lane * one_.size() + actuator];
  }
  /// Tickets begin anew.
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
