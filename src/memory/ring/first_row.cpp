#include "memory/ring/first_row.hpp"

#include <unistd.h>

#include <algorithm>
#include <vector>

#include "memory/os/futex.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kGlance = 1'000'000;  // between polls of what cannot be slept on [ns]

bool is_there(const RowOf& wanted) noexcept {
  const Counters& counters = wanted.segment->view().counters();
  return counters.published.load(std::memory_order_acquire) >= wanted.row;  // sync published
}

void nap(std::int64_t at_most) noexcept {
  if (at_most > 0) usleep(static_cast<useconds_t>(std::min(at_most, kGlance) / 1000));
}

}  // namespace

Waited wait_for_first_row(std::span<const RowOf> rows, const Deadline& deadline,
                          const KeepWaiting& keep_waiting) {
  static Spinner spinner;
  for (const RowOf& wanted : rows) wanted.segment->check_process();
  const auto ready = [&] { return std::ranges::any_of(rows, is_there); };
  if (spinner.spin(ready)) return Waited::ready;

  const auto has_ended = [](const RowOf& wanted) { return wanted.segment->has_ended(); };
  // rows may have come before the end
  const auto throw_if_gone = [&] {
    const auto gone =
        std::ranges::find_if(rows, [](const RowOf& wanted) { return wanted.segment->gone(); });
    if (gone != rows.end() && !ready()) gone->segment->throw_if_gone();
  };
  std::vector<FutexWord> words;
  std::vector<const SegmentView*> views;
  // one sleep, which any of the rows ends
  const auto sleep = [&](std::int64_t at_most) {
    words.clear();
    views.clear();
    for (const RowOf& wanted : rows) {
      if (wanted.segment->access() != Access::read_write || words.size() == kMaxFutexWords)
        continue;
      const auto seen = register_for_row(*wanted.segment, wanted.row);
      if (!seen) return;
      views.push_back(&wanted.segment->view());
      words.push_back({.word = &views.back()->wakes().row_wake, .expected = *seen});
    }
    if (words.size() < rows.size()) at_most = std::min(at_most, kGlance);
    if (words.empty() || !futex_wait_any(words, at_most)) nap(at_most);
    // several may have been woken through this one
    for (std::size_t i = 0; i < words.size(); ++i) pass_on_wake(*views[i], words[i].expected);
  };
  std::int64_t poll_at = monotonic_now() + kSlice;
  while (!deadline.over()) {
    sleep(deadline.left(std::max<std::int64_t>(0, poll_at - monotonic_now())));
    if (ready()) return Waited::ready;
    if (monotonic_now() < poll_at && std::ranges::none_of(rows, has_ended)) continue;
    poll_at = monotonic_now() + kSlice;
    if (keep_waiting && !keep_waiting())
      throw Cancelled("the wait for the first of several rows was cancelled");
    throw_if_gone();
    if (ready()) return Waited::ready;
  }
  // a wait too short for a poll detects an end all the same
  throw_if_gone();
  return ready() ? Waited::ready : Waited::timed_out;
}

}  // namespace o80
