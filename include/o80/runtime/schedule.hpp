#pragma once

#include <cstdint>
#include <vector>

#include "o80/control/pool.hpp"

namespace o80 {

/// A batch that waits in the pool for its iteration.
struct ScheduledBatch {
  Iteration at = 0;
  std::uint64_t ticket = 0;
  BlockIndex batch = kNoBlock;
  std::uint32_t lane = 0;
  std::uint64_t owner = 0;  // incarnation of who sent it, 0: one that had left the lane before
  bool late_now = false;
  bool of_dead = false;  // its sender has died, whoever has the lane now
};

/// Batches sent for a later iteration, the next one first.
///
/// Writer:   the backend's thread.
/// Realtime: yes: a heap in memory reserved for as many as the lanes can hold.
class Schedule {
 public:
  explicit Schedule(std::size_t most) { heap_.reserve(most); }

  bool empty() const noexcept { return heap_.empty(); }
  const ScheduledBatch& next() const noexcept { return heap_.front(); }
  void add(const ScheduledBatch& batch) noexcept;
  void drop_next() noexcept;
  /// The sender of what this lane has sent so far is dead.
  void disown(std::uint32_t lane) noexcept;

 private:
  std::vector<ScheduledBatch> heap_;
};

}  // namespace o80
