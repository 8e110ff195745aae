// How one call waits for rows of several frontends.

#include "memory/ring/first_row.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"

namespace o80 {

namespace {

std::string not_in_time(std::span<const RowWish> wishes) {
  std::string text = "none of the rows was published in time:";
  for (const RowWish& wish : wishes) {
    const UntypedFrontend& frontend = *wish.frontend;
    text += (&wish == wishes.data() ? " '" : ", '") + frontend.segment() + "' is at row " +
            std::to_string(frontend.published()) + " of " + std::to_string(wish.row);
    if (frontend.bursting()) text += " (it waits for a burst)";
  }
  return text;
}

}  // namespace

std::vector<std::size_t> wait_for_first(std::span<const RowWish> wishes, Timeout timeout,
                                        const KeepWaiting& keep_waiting) {
  if (wishes.empty()) throw InvalidArgument("a wait for the first of several rows needs a row");
  std::vector<std::shared_ptr<Link>> links;  // kept alive while it waits
  std::vector<RowOf> rows;
  for (const RowWish& wish : wishes) {
    const auto& link = links.emplace_back(wish.frontend->link());
    link->check_usable();
    if (wish.row < 0) {
      throw InvalidArgument("there is no row " + std::to_string(wish.row) + " of '" +
                            wish.frontend->segment() + "': rows begin at 0");
    }
    rows.push_back({.segment = &link->segment, .row = wish.row});
  }
  const KeepWaiting guarded = [&] {
    const KeepWaiting nothing;
    for (const auto& link : links) link->guarded(nothing)();
    return !keep_waiting || keep_waiting();
  };
  if (wait_for_first_row(rows, Deadline(timeout), guarded) == Waited::timed_out) {
    throw TimeoutError(not_in_time(wishes));
  }
  std::vector<std::size_t> there;
  for (std::size_t i = 0; i < wishes.size(); ++i) {
    if (links[i]->history.published() >= wishes[i].row) there.push_back(i);
  }
  return there;
}

}  // namespace o80
