#pragma once

#include <cstdint>
#include <vector>

#include "control/ledger.hpp"
#include "control/pool.hpp"

namespace o80 {

/// Records of several lanes, first in first out; all that one lane sent can leave in one step.
///
/// Each lane has a list of its own, and the first record of what was appended at once bears its
/// turn: the front is the list whose first record came first.
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
  /// The first record of all, if there is one.
  BlockIndex front() const noexcept { return front_ == kNoLane ? kNoBlock : lists_[front_].first; }
  /// Whose it is.
  std::uint32_t front_lane() const noexcept { return front_; }

  /// Adds a list of records of one lane, linked by Own::kNext.
  void append(BlockIndex first, BlockIndex last, std::uint32_t lane) noexcept;
  /// Takes the front away.
  void pop() noexcept;
  /// Takes all of a lane away: the first of its records, linked by Own::kNext.
  BlockIndex take(std::uint32_t lane) noexcept;
  /// The same for any lane that has some; no block when there is none.
  BlockIndex take_any() noexcept { return used_.empty() ? kNoBlock : take(used_.back()); }

 private:
  struct List {
    BlockIndex first = kNoBlock;
    BlockIndex last = kNoBlock;
    std::uint32_t turn = 0;  // of the first
  };

  void choose_front() noexcept;
  void leave(std::uint32_t lane) noexcept;

  BlockPool* pool_;
  std::vector<List> lists_;
  std::vector<std::uint32_t> used_;  // lanes that have some
  std::uint32_t front_ = kNoLane;
  std::uint32_t next_turn_ = 0;
};

}  // namespace o80
