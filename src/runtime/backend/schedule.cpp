#include "runtime/backend/schedule.hpp"

#include <algorithm>

namespace o80 {

namespace {
/// Order for the standard heap functions, which keep the largest first: the earliest is on top.
bool later(const StagedBatch& a, const StagedBatch& b) noexcept {
  return a.at != b.at ? a.at > b.at : a.ticket > b.ticket;
}
}  // namespace

Schedule::Schedule(std::uint32_t lanes)
    : iterations_(std::size_t{lanes} * kMaxScheduled), counts_(lanes) {
  heap_.reserve(iterations_.size());
  aside_.reserve(2 * iterations_.size());
}

bool Schedule::has_room(std::uint32_t lane, Iteration at) const noexcept {
  if (counts_[lane] >= kMaxScheduled) return false;
  return std::ranges::count(of(lane), at) < std::ptrdiff_t{kMaxScheduledAt};
}

void Schedule::add(const StagedBatch& batch) noexcept {
  iterations_[std::size_t{batch.lane} * kMaxScheduled + counts_[batch.lane]++] = batch.at;
  heap_.push_back(batch);
  std::push_heap(heap_.begin(), heap_.end(), later);
}

void Schedule::drop_next() noexcept {
  const std::uint32_t lane = next().lane;
  Iteration* const first = iterations_.data() + std::size_t{lane} * kMaxScheduled;
  *std::find(first, first + counts_[lane] - 1, next().at) = first[counts_[lane] - 1];
  --counts_[lane];
  std::pop_heap(heap_.begin(), heap_.end(), later);
  heap_.pop_back();
}

void Schedule::set_aside() noexcept {
  // no room beside the batches of an earlier halt: these stay scheduled and are checked when due
  if (aside_.size() + heap_.size() > aside_.capacity()) return;
  aside_.insert(aside_.end(), heap_.begin(), heap_.end());
  heap_.clear();
  std::ranges::fill(counts_, 0);
}

void Schedule::set_aside_of_silent(std::uint32_t lane) noexcept {
  if (counts_[lane] == 0) return;
  for (StagedBatch& batch : heap_) batch.silent = batch.silent || batch.lane == lane;
  if (aside_.size() + counts_[lane] > aside_.capacity()) return;
  const auto rest =
      std::ranges::partition(heap_, [&](const StagedBatch& batch) { return batch.lane != lane; });
  aside_.insert(aside_.end(), rest.begin(), rest.end());
  heap_.erase(rest.begin(), rest.end());
  std::ranges::make_heap(heap_, later);
  counts_[lane] = 0;
}

StagedBatch Schedule::take_aside() noexcept {
  const StagedBatch batch = aside_.back();
  aside_.pop_back();
  return batch;
}

}  // namespace o80
