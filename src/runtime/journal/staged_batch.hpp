#pragma once

#include <cstdint>

#include "control/receiving/pool.hpp"

namespace o80 {

/// A batch that is complete in the pool and was checked.
struct StagedBatch {
  Iteration at = kNow;
  std::uint64_t ticket = 0;
  BlockIndex batch = kNoBlock;
  std::uint32_t lane = 0;
  std::uint64_t incarnation = 0;  // owner of the lane when staging began
  bool sender_left = false;       // the sender had closed or lost the lane by then
  bool of_dead = false;           // and was known to be dead
  bool late_now = false;
  bool silent = false;  // the watchdog has found the sender silent since
};

}  // namespace o80
