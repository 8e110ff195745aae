// Waiting for rows: nobody sleeps on while the row it wants is there, though no slice ever passes.
// One is woken, the first awake wakes the rest.
//
// mutant waiter_looks_relaxed: src/memory/segment/signal.cpp
//   - if (view.counters().published.load(std::memory_order_seq_cst) >= k) {
//   + if (view.counters().published.load(std::memory_order_relaxed) >= k) {
// mutant published_with_release: src/memory/ring/history.cpp
//   - counters_->published.store(k, std::memory_order_seq_cst);
//   + counters_->published.store(k, std::memory_order_release);
// mutant writer_looks_relaxed: src/memory/segment/signal.cpp
//   - bell.wanted.load(std::memory_order_seq_cst) > k
//   + bell.wanted.load(std::memory_order_relaxed) > k
// mutant never_asked: src/memory/segment/signal.cpp
//   - while (k < lowest &&
//   + while (k < 0 &&
// mutant nobody_tells_the_rest: src/memory/segment/signal.cpp
//   - futex_wake(wake, kEverybody);
//   +
// mutant reset_after_the_wake: src/memory/segment/signal.cpp
//   - bell.wanted.store(kNoWish, std::memory_order_seq_cst);  // sync wanted
//   +
//   - O80_CRASH_POINT("rows.after_wake");
//   + if (sleepers.rows) view.bell().wanted.store(kNoWish, std::memory_order_seq_cst);
// mutant sleeps_on_a_later_value: src/memory/segment/signal.cpp
//   - futex_wait(view_.wakes().row_wake, *seen, at_most)
//   + futex_wait(view_.wakes().row_wake,
//   +            view_.wakes().row_wake.load(std::memory_order_seq_cst), at_most)

#include "kernel.hpp"

namespace {

constexpr o80::Iteration kRows = 2;

/// Three wait, each for its own rows, while rows come.
struct Rows : rl::test_suite<Rows, 4> {
  model::Segment segment{1, 4, 0, 1};

  void thread(unsigned index) {
    if (index == 0) return write();
    const o80::AttachedSegment attached = model::attach();
    o80::RowWaiter waiter(attached);
    if (index == 1) waiter.wait_for_row(0, o80::Deadline({}));
    waiter.wait_for_row(index == 3 ? 0 : 1, o80::Deadline({}));
  }

  void write() {
    o80::HistoryWriter writer(segment.view);
    o80::RowSignal signal(segment.view);
    const std::uint64_t row = 0;
    for (o80::Iteration k = 0; k < kRows; ++k) {
      writer.publish(k, reinterpret_cast<const std::byte*>(&row));
      o80::wake_sleepers(segment.view, {.rows = signal.announce(k)});
    }
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Rows>(count, arguments); }
