#include "memory/segment/running_slot.hpp"

#include <algorithm>
#include <iterator>

#include "memory/os/atomic_words.hpp"

namespace o80 {

namespace {

constexpr int kRunningReadings = 1000;  // retries while the slot is being written

enum class Reading : std::uint8_t { whole, unused, torn };

Reading read_running(const RunningSlot& slot, RunningRequest& request) noexcept {
  const std::uint64_t number = slot.number.load(std::memory_order_acquire);  // sync running_number
  if (number == 0) return Reading::unused;
  request.id = slot.id.load(std::memory_order_acquire);            // sync running_words
  request.since = slot.since.load(std::memory_order_acquire);      // sync running_words
  request.lane = slot.lane.load(std::memory_order_acquire);        // sync running_words
  request.request = slot.request.load(std::memory_order_acquire);  // sync running_words
  load_text(slot.who, std::size(slot.who), request.who.data());
  load_text(slot.progress, std::size(slot.progress), request.progress.data());
  return slot.number.load(std::memory_order_relaxed) == number ? Reading::whole : Reading::torn;
}

/// Empty if the slot is unused, or if the backend was killed while it wrote the slot.
std::optional<RunningRequest> whole_running(const RunningSlot& slot) noexcept {
  for (int i = 0; i < kRunningReadings; ++i) {
    RunningRequest request;
    const Reading reading = read_running(slot, request);
    if (reading == Reading::whole) return request;
  }
  return std::nullopt;
}

}  // namespace

void show_running(RunningSlot& slot, std::uint64_t number, const RunningRequest& request) noexcept {
  slot.number.store(0, std::memory_order_relaxed);
  slot.id.store(request.id, std::memory_order_release);            // sync running_words
  slot.since.store(request.since, std::memory_order_release);      // sync running_words
  slot.lane.store(request.lane, std::memory_order_release);        // sync running_words
  slot.request.store(request.request, std::memory_order_release);  // sync running_words
  store_text(slot.who, std::size(slot.who), request.who_text());
  store_text(slot.progress, std::size(slot.progress), request.progress_text());
  slot.number.store(number, std::memory_order_release);  // sync running_number
}

void hide_running(RunningSlot& slot) noexcept { slot.number.store(0, std::memory_order_relaxed); }

std::vector<RunningRequest> running_requests(const SegmentView& view) {
  std::vector<RunningRequest> all;
  for (const RunningSlot& slot : view.counters().running) {
    const auto request = whole_running(slot);
    if (!request) continue;
    all.insert(std::ranges::upper_bound(all, request->since, {}, &RunningRequest::since), *request);
  }
  return all;
}

std::optional<RunningRequest> running_request(const SegmentView& view, std::uint32_t lane,
                                              std::uint64_t id) noexcept {
  for (const RunningSlot& slot : view.counters().running) {
    if (slot.id.load(std::memory_order_relaxed) != id) continue;
    const auto request = whole_running(slot);
    if (request && request->lane == lane && request->id == id) return request;
  }
  return std::nullopt;
}

}  // namespace o80
