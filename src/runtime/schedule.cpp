#include "o80/runtime/schedule.hpp"

#include <algorithm>
#include <utility>

namespace o80 {

namespace {
/// Turns the standard heap, largest first, into one with the earliest first.
bool later(const StagedBatch& a, const StagedBatch& b) noexcept {
  return a.at != b.at ? a.at > b.at : a.ticket > b.ticket;
}
}  // namespace

Schedule::Schedule(std::uint32_t lanes)
    : iterations_(std::size_t{lanes} * kMostScheduled), counts_(lanes) {
  heap_.reserve(iterations_.size());
  aside_.reserve(iterations_.size());
}

bool Schedule::has_room(std::uint32_t lane, Iteration at) const noexcept {
  if (counts_[lane] >= kMostScheduled) return false;
  return std::ranges::count(of(lane), at) < std::ptrdiff_t{kMostScheduledAt};
}

void Schedule::add(const StagedBatch& batch) noexcept {
  iterations_[std::size_t{batch.lane} * kMostScheduled + counts_[batch.lane]++] = batch.at;
  heap_.push_back(batch);
  std::push_heap(heap_.begin(), heap_.end(), later);
}

void Schedule::drop_next() noexcept {
  const std::uint32_t lane = next().lane;
  Iteration* const first = iterations_.data() + std::size_t{lane} * kMostScheduled;
  *std::find(first, first + counts_[lane] - 1, next().at) = first[counts_[lane] - 1];
  --counts_[lane];
  std::pop_heap(heap_.begin(), heap_.end(), later);
  heap_.pop_back();
}

void Schedule::set_aside() noexcept {
  if (has_aside()) return;
  std::swap(heap_, aside_);
  std::ranges::fill(counts_, 0);
}

StagedBatch Schedule::take_aside() noexcept {
  const StagedBatch batch = aside_.back();
  aside_.pop_back();
  return batch;
}

}  // namespace o80
