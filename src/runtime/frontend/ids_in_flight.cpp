#include "runtime/frontend/ids_in_flight.hpp"

#include <algorithm>

namespace o80 {

std::optional<CommandId> IdsInFlight::draw(CommandId next, std::uint64_t n,
                                           const HasEnded& has_ended) {
  return draw_up_to(next, n, places_ - kept_, has_ended);
}

std::optional<CommandId> IdsInFlight::draw_kept(CommandId next, std::uint64_t n,
                                                const HasEnded& has_ended) {
  if (const auto first = draw_up_to(next, n, places_, has_ended)) return first;
  // skip ids up to the reserved slots
  const std::uint64_t begin = places_ - kept_;
  const CommandId first = next + (begin + places_ - next % places_) % places_;
  return draw_up_to(first, n, places_, has_ended, From::exactly_here);
}

/// `first`, or the start of the next revolution if n ids from `first` on do not fit before
/// `places_end`.
CommandId IdsInFlight::fit(CommandId first, std::uint64_t n,
                           std::uint64_t places_end) const noexcept {
  if (places_end == places_ || first % places_ + n <= places_end) return first;
  return first + places_ - first % places_;
}

/// Draws from the slots before `places_end` of each revolution. If that is all of them, ids may
/// continue into the next revolution.
std::optional<CommandId> IdsInFlight::draw_up_to(CommandId next, std::uint64_t n,
                                                 std::uint64_t places_end,
                                                 const HasEnded& has_ended, From from) {
  CommandId first = next;
  if (!runs_.empty()) first = std::max(first, runs_.back().begin + runs_.back().count);
  const CommandId revolution = first + places_;
  first = fit(first, n, places_end);
  std::size_t moved = 0;
  // the slots of the oldest batch are reused first
  while (!runs_.empty() && runs_.front().begin + places_ < first + n) {
    Run run = runs_.front();
    runs_.pop_front();
    if (has_ended(run.end_id)) continue;
    run.begin += places_;
    first = fit(std::max(first, run.begin + run.count), n, places_end);
    runs_.push_back(run);
    ++moved;
    if (first > revolution || (from == From::exactly_here && first != next)) {
      go_back(moved);
      return std::nullopt;
    }
  }
  return first;
}

/// Undoes the last `moved` skips, because nothing was drawn.
void IdsInFlight::go_back(std::size_t moved) {
  for (; moved > 0; --moved) {
    Run run = runs_.back();
    runs_.pop_back();
    run.begin -= places_;
    runs_.push_front(run);
  }
}

}  // namespace o80
