// How a frontend finds rows by their times.

#include <algorithm>

#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"

namespace o80 {

Iteration UntypedFrontend::iteration_at(std::int64_t time) const {
  link_->check_usable();
  return link_->iteration_at(time);
}

Iteration Link::iteration_at(std::int64_t time) const {
  UntypedObservation row(description);
  // times do not decrease: search by halves from the oldest row to the newest
  Iteration below = history.oldest() - 1;
  Iteration above = history.published() + 1;
  while (above - below > 1) {
    const Iteration middle = below + (above - below) / 2;
    if (!history.read(middle, row.bytes())) {
      if (history.is_damaged()) throw damaged();
      // overwritten meanwhile: count it as before the oldest row
      below = std::max(middle, history.oldest() - 1);
      above = std::max(above, below + 1);
    } else if (row.time() <= time) {
      below = middle;
    } else {
      above = middle;
    }
  }
  return below;
}

UntypedObservation UntypedFrontend::at_time(std::int64_t time) const {
  UntypedObservation row(link_->description);
  const Iteration k = iteration_at(time);
  if (k >= 0 && link_->history.read(k, row.bytes()) && row.time() <= time) return row;
  throw RowOverwritten("'" + segment() + "' has no row of " + std::to_string(time) +
                       " ns or before: the oldest one is row " +
                       std::to_string(link_->history.oldest()));
}

Rows UntypedFrontend::history_between(std::int64_t first, std::int64_t last) const {
  const Iteration begin = iteration_at(first - 1) + 1;
  return history(begin, iteration_at(last));
}

}  // namespace o80
