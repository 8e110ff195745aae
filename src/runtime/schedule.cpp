#include "o80/runtime/schedule.hpp"

#include <algorithm>

namespace o80 {

namespace {
/// Turns the standard heap, largest first, into one with the earliest first.
bool later(const ScheduledBatch& a, const ScheduledBatch& b) noexcept {
  return a.at != b.at ? a.at > b.at : a.ticket > b.ticket;
}
}  // namespace

void Schedule::add(const ScheduledBatch& batch) noexcept {
  heap_.push_back(batch);
  std::push_heap(heap_.begin(), heap_.end(), later);
}

void Schedule::drop_next() noexcept {
  std::pop_heap(heap_.begin(), heap_.end(), later);
  heap_.pop_back();
}

void Schedule::disown(std::uint32_t lane) noexcept {
  for (ScheduledBatch& batch : heap_)
    if (batch.lane == lane) batch.of_dead = true;
}

}  // namespace o80
