#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "control/receiving/ledger.hpp"
#include "control/receiving/pool.hpp"

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
  LaneLists(BlockPool& pool, std::uint32_t lanes) : pool_(&pool), lists_(lanes) {
    used_.reserve(lanes);
  }

  bool empty() const noexcept { return front_ == kNoLane; }
  bool has(std::uint32_t lane) const noexcept { return lists_[lane].first != kNoBlock; }
  /// The first record; kNoBlock if the queue is empty.
  BlockIndex front() const noexcept { return front_ == kNoLane ? kNoBlock : lists_[front_].first; }

  /// Appends a list of records of one lane, linked by Own::kNext.
  void append(BlockIndex first, BlockIndex last, std::uint32_t lane) noexcept {
    if (next_turn_ == kNoTurn) next_turn_ = 0;
    pool_->head(first).own[Own::kTurn] = next_turn_;
    List& list = lists_[lane];
    if (list.first == kNoBlock) {
      list.first = first;
      list.turn = next_turn_;
      used_.push_back(lane);
      if (front_ == kNoLane) front_ = lane;
    } else {
      pool_->head(list.last).own[Own::kNext] = first;
    }
    ++next_turn_;
    list.last = last;
  }
  /// Removes front().
  void pop() noexcept {
    List& list = lists_[front_];
    list.first = pool_->head(list.first).own[Own::kNext];
    if (list.first == kNoBlock) return leave(front_);
    const std::uint32_t turn = pool_->head(list.first).own[Own::kTurn];
    if (turn == kNoTurn) return;
    list.turn = turn;
    choose_front();
  }
  /// Removes all records of a lane; returns the first, linked by Own::kNext.
  BlockIndex take(std::uint32_t lane) noexcept {
    const BlockIndex first = lists_[lane].first;
    if (first != kNoBlock) leave(lane);
    return first;
  }
  /// The same for any lane that has records; kNoBlock if there is none.
  BlockIndex take_any() noexcept { return used_.empty() ? kNoBlock : take(used_.back()); }

 private:
  static constexpr std::uint32_t kNoLane = 0xFFFFFFFF;
  /// Own::kTurn of a record that is not the first of an append().
  static constexpr std::uint32_t kNoTurn = 0xFFFFFFFF;

  struct List {
    BlockIndex first = kNoBlock;
    BlockIndex last = kNoBlock;
    std::uint32_t turn = 0;  // turn of the first record
  };

  void leave(std::uint32_t lane) noexcept {
    lists_[lane] = {};
    *std::ranges::find(used_, lane) = used_.back();
    used_.pop_back();
    if (lane == front_) choose_front();
  }
  void choose_front() noexcept {
    // compare ages, not turns: the counter may have wrapped around
    const auto age = [&](std::uint32_t lane) { return next_turn_ - lists_[lane].turn; };
    const auto oldest = std::ranges::max_element(used_, {}, age);
    front_ = oldest == used_.end() ? kNoLane : *oldest;
  }

  BlockPool* pool_;
  std::vector<List> lists_;
  std::vector<std::uint32_t> used_;  // lanes that have records
  std::uint32_t front_ = kNoLane;
  std::uint32_t next_turn_ = 0;
};

}  // namespace o80
