#pragma once

#include <cstdint>
#include <vector>

#include "control/ledger.hpp"
#include "control/pool.hpp"

namespace o80 {

/// A queue of the records of all lanes, from which all records of one lane can be removed in one
/// step.
///
/// Each lane has its own list. The first record of each append() stores a turn number; the front is
/// the first record with the oldest turn.
///
/// Realtime: everything but construction.
class LaneLists {
 public:
  static constexpr std::uint32_t kNoLane = 0xFFFFFFFF;

  LaneLists(BlockPool& pool, std::uint32_t lanes) : pool_(&pool), lists_(lanes) {
    used_.reserve(lanes);
  }

  bool empty() const noexcept { return front_ == kNoLane; }
  bool has(std::uint32_t lane) const noexcept { return lists_[lane].first != kNoBlock; }
  /// The first record; kNoBlock if the queue is empty.
  BlockIndex front() const noexcept { return front_ == kNoLane ? kNoBlock : lists_[front_].first; }

  /// Appends a list of records of one lane, linked by Own::kNext.
  void append(BlockIndex first, BlockIndex last, std::uint32_t lane) noexcept;
  /// Removes front().
  void pop() noexcept;
  /// Removes all records of a lane; returns the first, linked by Own::kNext.
  BlockIndex take(std::uint32_t lane) noexcept;
  /// The same for any lane that has records; kNoBlock if there is none.
  BlockIndex take_any() noexcept { return used_.empty() ? kNoBlock : take(used_.back()); }

 private:
  struct List {
    BlockIndex first = kNoBlock;
    BlockIndex last = kNoBlock;
    std::uint32_t turn = 0;  // turn of the first record
  };

  void choose_front() noexcept;
  void leave(std::uint32_t lane) noexcept;

  BlockPool* pool_;
  std::vector<List> lists_;
  std::vector<std::uint32_t> used_;  // lanes that have records
  std::uint32_t front_ = kNoLane;
  std::uint32_t next_turn_ = 0;
};

}  // namespace o80
