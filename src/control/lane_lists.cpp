#include "control/lane_lists.hpp"

#include <algorithm>

namespace o80 {

namespace {
/// Own::kTurn of a record that is not the first of an append().
constexpr std::uint32_t kNoTurn = 0xFFFFFFFF;
}  // namespace

void LaneLists::append(BlockIndex first, BlockIndex last, std::uint32_t lane) noexcept {
  if (next_turn_ == kNoTurn) next_turn_ = 0;
  const std::uint32_t turn = next_turn_++;
  pool_->head(first).own[Own::kTurn] = turn;
  List& list = lists_[lane];
  if (list.first == kNoBlock) {
    list.first = first;
    list.turn = turn;
    used_.push_back(lane);
    if (front_ == kNoLane) front_ = lane;
  } else {
    pool_->head(list.last).own[Own::kNext] = first;
  }
  list.last = last;
}

void LaneLists::pop() noexcept {
  List& list = lists_[front_];
  list.first = pool_->head(list.first).own[Own::kNext];
  if (list.first == kNoBlock) return leave(front_);
  const std::uint32_t turn = pool_->head(list.first).own[Own::kTurn];
  if (turn == kNoTurn) return;
  list.turn = turn;
  choose_front();
}

BlockIndex LaneLists::take(std::uint32_t lane) noexcept {
  const BlockIndex first = lists_[lane].first;
  if (first != kNoBlock) leave(lane);
  return first;
}

void LaneLists::leave(std::uint32_t lane) noexcept {
  lists_[lane] = {};
  *std::find(used_.begin(), used_.end(), lane) = used_.back();
  used_.pop_back();
  if (lane == front_) choose_front();
}

void LaneLists::choose_front() noexcept {
  front_ = kNoLane;
  std::uint32_t oldest = 0;
  for (const std::uint32_t lane : used_) {
    // compare ages, not turns: the counter may have wrapped around
    const std::uint32_t age = next_turn_ - lists_[lane].turn;
    if (front_ != kNoLane && age <= oldest) continue;
    front_ = lane;
    oldest = age;
  }
}

}  // namespace o80
