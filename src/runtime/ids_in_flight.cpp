#include "o80/runtime/ids_in_flight.hpp"

#include <algorithm>

namespace o80 {

std::optional<CommandId> IdsInFlight::draw(CommandId next, std::uint64_t n,
                                           const HasEnded& has_ended) {
  CommandId first = next;
  if (!runs_.empty()) first = std::max(first, runs_.back().begin + runs_.back().count);
  const CommandId revolution = first + places_;
  std::size_t moved = 0;
  // the places of the oldest come round first
  while (!runs_.empty() && runs_.front().begin + places_ < first + n) {
    Run run = runs_.front();
    runs_.pop_front();
    if (has_ended(run.end_id)) continue;
    run.begin += places_;
    first = std::max(first, run.begin + run.count);
    runs_.push_back(run);
    ++moved;
    if (first > revolution) {
      go_back(moved);
      return std::nullopt;
    }
  }
  return first;
}

/// Nothing was drawn: the places of the last `moved` come round as before.
void IdsInFlight::go_back(std::size_t moved) {
  for (; moved > 0; --moved) {
    Run run = runs_.back();
    runs_.pop_back();
    run.begin -= places_;
    runs_.push_front(run);
  }
}

}  // namespace o80
