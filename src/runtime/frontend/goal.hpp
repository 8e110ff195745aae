#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "control/motion/state_layout.hpp"
#include "o80/runtime/move.hpp"

namespace o80 {

/// The targets of a move, and how near each number must be observed.
class Move::Goal {
 public:
  /// Throws InvalidArgument for tolerances that do not fit. States and masks have been checked.
  Goal(const Schema& schema, std::span<const std::uint32_t> actuators,
       std::span<const std::byte> states, std::span<const std::uint64_t> masks,
       const MoveOptions& options);

  /// The numbers of a row that are too far from their targets.
  std::vector<Miss> misses(const UntypedObservation& row) const;

 private:
  struct Judged {
    StateLayout layout;
    std::size_t number;
    std::uint32_t offset;  // of the state in the block of a row
    Miss miss;             // what to report: all but what is observed
  };
  std::vector<Judged> judged_;
};

/// The text of NotReached.
std::string not_reached_text(const std::string& segment, const std::vector<Miss>& misses,
                             const Batch& batch, Timeout timeout);

}  // namespace o80
