#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "control/pool.hpp"

namespace o80 {

// batches that one lane may have waiting for later iterations; `pulse` refuses more
inline constexpr std::uint32_t kMostScheduled = 256;
inline constexpr std::uint32_t kMostScheduledAt = 16;  // for the same iteration

/// A batch that is complete in the pool.
struct StagedBatch {
  Iteration at = kNow;
  std::uint64_t ticket = 0;
  BlockIndex batch = kNoBlock;
  std::uint32_t lane = 0;
  std::uint64_t incarnation = 0;  // of the lane when its staging began
  bool had_left = false;          // its sender no longer had the lane then
  bool of_dead = false;           // and was known to be dead
  bool late_now = false;
  bool silent = false;  // its sender has fallen silent since
};

/// Batches sent for a later iteration, the next one first.
///
/// Writer:   the backend's thread.
/// Realtime: yes: a heap in memory reserved for as many as all lanes may have.
class Schedule {
 public:
  explicit Schedule(std::uint32_t lanes);

  bool empty() const noexcept { return heap_.empty(); }
  const StagedBatch& next() const noexcept { return heap_.front(); }
  /// Whether a lane may have one more for this iteration.
  bool has_room(std::uint32_t lane, Iteration at) const noexcept;
  /// To be asked only if there is room.
  void add(const StagedBatch& batch) noexcept;
  void drop_next() noexcept;

  /// All that is there is no longer scheduled, but waits to be judged one by one (after a halt).
  void set_aside() noexcept;
  /// The same for what one lane has there, whose sender has fallen silent; O(batches).
  void set_aside_of_silent(std::uint32_t lane) noexcept;
  bool has_aside() const noexcept { return !aside_.empty(); }
  StagedBatch take_aside() noexcept;

 private:
  std::span<const Iteration> of(std::uint32_t lane) const noexcept {
    return {iterations_.data() + std::size_t{lane} * kMostScheduled, counts_[lane]};
  }

  std::vector<StagedBatch> heap_;
  std::vector<StagedBatch> aside_;
  std::vector<Iteration> iterations_;  // of each lane's batches, in no order
  std::vector<std::uint32_t> counts_;  // of each lane
};

}  // namespace o80
