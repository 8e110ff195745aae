#include "memory/segment/signal.hpp"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <limits>

#include "base/crash_point.hpp"
#include "memory/os/futex.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {
constexpr Iteration kNoWish = std::numeric_limits<Iteration>::max();
constexpr std::int64_t kMargin = 10'000;   // of the expected time of a row [ns]
constexpr std::int64_t kPoll = 1'000'000;  // interval of a read-only waiter [ns]
}  // namespace

Waited RowWaiter::wait_for_row(Iteration k, const Deadline& deadline,
                               const KeepWaiting& keep_waiting) {
  segment_->check_process();
  const std::atomic<std::int64_t>& published = view_.counters().published;
  const auto ready = [&] {
    return published.load(std::memory_order_acquire) >= k;  // sync published
  };
  if (time_until(k) > Spinner::kLongest ? ready() : spinner_.spin(ready)) return Waited::ready;
  std::int64_t poll_at = monotonic_now() + kSlice;
  std::int64_t nap = kSlice;  // time until poll_at [ns]
  while (!deadline.over()) {
    if (segment_->access() == Access::read_write)
      sleep(k, deadline.left(nap));
    else
      poll(k, deadline.left(nap));
    if (ready()) return Waited::ready;
    nap = poll_at - monotonic_now();
    if (nap > 0 && !segment_->has_ended()) continue;
    poll_at = monotonic_now() + kSlice;
    nap = kSlice;
    if (keep_waiting && !keep_waiting())
      throw Cancelled("the wait for a row of segment '" + segment_->name() + "' was cancelled");
    // first the end, then the row: the row may have been published before the end
    const bool gone = segment_->gone();
    if (ready()) return Waited::ready;
    if (gone) segment_->throw_if_gone();
  }
  // a wait shorter than one slice checks for the end of the backend too
  const bool gone = segment_->gone();
  if (ready()) return Waited::ready;
  if (gone) segment_->throw_if_gone();
  return Waited::timed_out;
}

std::optional<std::uint32_t> register_for_row(const AttachedSegment& segment,
                                              Iteration k) noexcept {
  const SegmentView& view = segment.view();
  Bell& bell = view.bell();

  // lower the word, look again
  O80_CRASH_POINT("rows.before_register");
  const std::uint32_t seen =
      view.wakes().row_wake.load(std::memory_order_seq_cst);  // sync row_wake
  // the end is stored before `row_wake` changes: has_ended() is reliable after the load above
  if (segment.has_ended()) return std::nullopt;
  Iteration lowest = bell.wanted.load(std::memory_order_seq_cst);  // sync wanted
  while (k < lowest &&
         !bell.wanted.compare_exchange_weak(lowest, k, std::memory_order_seq_cst)) {  // sync wanted
  }
  O80_CRASH_POINT("rows.before_sleep");
  if (view.counters().published.load(std::memory_order_seq_cst) >= k) {  // sync published
    return std::nullopt;
  }
  return seen;
}

void pass_on_wake(const SegmentView& view, std::uint32_t seen) noexcept {
  std::atomic<std::uint32_t>& wake = view.wakes().row_wake;
  Bell& bell = view.bell();
  const std::uint32_t now = wake.load(std::memory_order_seq_cst);  // sync row_wake
  if (now == seen || bell.passed_on.exchange(now, std::memory_order_relaxed) == now) return;
  O80_CRASH_POINT("rows.before_pass_on");
  futex_wake(wake, kEverybody);
}

std::int64_t RowWaiter::time_until(Iteration k) const noexcept {
  const Counters& counters = view_.counters();
  // first the time, then the row: the writer stores them in the other order
  const std::int64_t at = counters.next_at.load(std::memory_order_acquire);  // sync next_at
  const bool is_next = counters.published.load(std::memory_order_relaxed) + 1 == k;
  return is_next && at != 0 ? std::max<std::int64_t>(0, at - monotonic_now()) : 0;
}

void RowWaiter::sleep(Iteration k, std::int64_t at_most) noexcept {
  const std::int64_t left = time_until(k);
  if (left > 0 && view_.counters().processor.load(std::memory_order_relaxed) == sched_getcpu()) {
    usleep(static_cast<useconds_t>(std::min(left, at_most) / 1000));
    return;
  }
  const std::optional<std::uint32_t> seen = register_for_row(*segment_, k);
  if (!seen || !futex_wait(view_.wakes().row_wake, *seen, at_most)) return;
  pass_on_wake(view_, *seen);
}

void RowWaiter::poll(Iteration k, std::int64_t at_most) noexcept {
  // not on the futex: a read-only reader would consume the one wake-up and cannot pass it on
  const Counters& counters = view_.counters();
  const std::int64_t end = monotonic_now() + at_most;
  for (std::int64_t left = at_most; left > 0; left = end - monotonic_now()) {
    usleep(static_cast<useconds_t>(std::min(left, kPoll) / 1000));
    if (counters.published.load(std::memory_order_acquire) >= k) return;  // sync published
    if (segment_->has_ended()) return;
  }
}

bool RowSignal::announce(Iteration k) noexcept {
  Bell& bell = view_.bell();
  if (bell.wanted.load(std::memory_order_seq_cst) > k) return false;  // sync wanted
  O80_CRASH_POINT("rows.before_reset");
  bell.wanted.store(kNoWish, std::memory_order_seq_cst);  // sync wanted
  O80_CRASH_POINT("rows.before_wake");
  // after the reset: a reader that lowered `wanted` before has the old `row_wake` and does not
  // sleep
  view_.wakes().row_wake.fetch_add(1, std::memory_order_seq_cst);  // sync row_wake
  return true;
}

void RowSignal::expect_next(std::int64_t due, std::int64_t period) noexcept {
  const std::int64_t delay = monotonic_now() - (due - period);
  Counters& counters = view_.counters();
  counters.processor.store(sched_getcpu(), std::memory_order_relaxed);
  // the lesser of two delays: one late row does not make the next one late
  const std::int64_t at = due + std::min(delay, delay_) + kMargin;
  counters.next_at.store(at, std::memory_order_release);  // sync next_at
  delay_ = delay;
}

void wake_sleepers(const SegmentView& view, Sleepers sleepers) noexcept {
  if (!sleepers.lanes && !sleepers.rows) return;
  Wakes& wakes = view.wakes();
  if (sleepers.lanes && sleepers.rows) {
    futex_wake_both(wakes.row_wake, 1, wakes.lane_wake);
  } else if (sleepers.lanes) {
    futex_wake(wakes.lane_wake, kEverybody);
  } else {
    futex_wake(wakes.row_wake, 1);
  }
  O80_CRASH_POINT("rows.after_wake");
}

std::uint32_t BellWaiter::value() const noexcept {
  return view_.bell().rung.load(std::memory_order_acquire);  // sync bell
}

bool BellWaiter::wait(std::uint32_t seen, std::int64_t at_most) noexcept {
  const auto rang = [&] { return value() != seen; };
  if (spinner_.spin(rang)) return true;
  std::atomic<std::uint32_t>& sleeping = view_.wakes().sleeping;
  sleeping.store(1, std::memory_order_seq_cst);  // sync sleeping
  O80_CRASH_POINT("bell.before_sleep");
  const Bell& bell = view_.bell();
  if (bell.rung.load(std::memory_order_seq_cst) == seen)  // sync bell
    futex_wait(bell.rung, seen, std::min(at_most, kSlice));
  O80_CRASH_POINT("bell.after_sleep");
  sleeping.store(0, std::memory_order_relaxed);
  return rang();
}

void ring_bell(const SegmentView& view) noexcept {
  Bell& bell = view.bell();
  O80_CRASH_POINT("bell.before_ring");
  bell.rung.fetch_add(1, std::memory_order_seq_cst);  // sync bell
  O80_CRASH_POINT("bell.after_ring");
  if (view.wakes().sleeping.load(std::memory_order_seq_cst) != 0)  // sync sleeping
    futex_wake(bell.rung, 1);
}

}  // namespace o80
