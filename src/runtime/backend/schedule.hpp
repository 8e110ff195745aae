#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/journal/staged_batch.hpp"
#include "runtime/protocol/schedule_limits.hpp"

namespace o80 {

/// Batches sent for a later iteration, ordered by iteration and ticket.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction, which reserves room for all batches of all lanes.
class Schedule {
 public:
  explicit Schedule(std::uint32_t lanes);

  bool empty() const noexcept { return heap_.empty(); }
  const StagedBatch& next() const noexcept { return heap_.front(); }
  /// True if the lane may schedule one more batch for this iteration.
  bool has_room(std::uint32_t lane, Iteration at) const noexcept;
  /// Call only if has_room().
  void add(const StagedBatch& batch) noexcept;
  void drop_next() noexcept;

  /// After a halt: moves all batches to the `aside` list, from which the backend checks them one by
  /// one and ends them or schedules them again.
  void set_aside() noexcept;
  /// The same for the batches of one lane whose sender is silent; O(batches).
  void set_aside_of_silent(std::uint32_t lane) noexcept;
  bool has_aside() const noexcept { return !aside_.empty(); }
  StagedBatch take_aside() noexcept;

 private:
  std::span<const Iteration> of(std::uint32_t lane) const noexcept {
    return {iterations_.data() + std::size_t{lane} * kMaxScheduled, counts_[lane]};
  }

  std::vector<StagedBatch> heap_;
  std::vector<StagedBatch> aside_;
  std::vector<Iteration> iterations_;  // of each lane's batches, unordered
  std::vector<std::uint32_t> counts_;  // of each lane
};

}  // namespace o80
