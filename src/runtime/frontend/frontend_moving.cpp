// How a frontend moves a robot and waits until it is observed there.

#include <algorithm>
#include <limits>

#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/goal.hpp"
#include "runtime/frontend/sending.hpp"

namespace o80 {

namespace {

/// What an iteration of a bursting backend may take at least, however short the timeout.
constexpr std::chrono::nanoseconds kShortestBurst = std::chrono::seconds(1);

/// Calls a KeepWaiting about every 50 ms in a loop whose waits may be too short to call it.
class Poll {
 public:
  Poll(const Link& link, const KeepWaiting& keep_waiting)
      : link_(link), keep_waiting_(keep_waiting) {}

  void operator()() {
    if (monotonic_now() < next_) return;
    next_ = monotonic_now() + kSlice;
    if (keep_waiting_()) return;
    throw Cancelled("the wait for '" + link_.segment.name() + "' was cancelled");
  }

 private:
  const Link& link_;
  const KeepWaiting& keep_waiting_;
  std::int64_t next_ = 0;
};

/// A robot that is halted does not move to its target any more.
void throw_if_halted(const Link& link) {
  const std::optional<Halt> halt = link.halt();
  if (!halt) return;
  const std::string text = link.halt_text(std::numeric_limits<Iteration>::max());
  throw BackendHalted("'" + link.segment.name() +
                      "' did not reach its targets: " + (text.empty() ? "it is halted" : text));
}

}  // namespace

Move UntypedFrontend::start_move(std::span<const std::uint32_t> actuators,
                                 std::span<const std::byte> states, const MoveOptions& options,
                                 std::span<const std::uint64_t> masks) {
  Move move;
  BatchBuilder builder;
  {
    const auto lock = link_->lock_to_add();
    add_commands_to(*link_, builder, actuators, states, options.command, masks);
  }
  move.goal_ = std::make_shared<const Move::Goal>(schema(), actuators, states, masks, options);
  move.batch_ = pulse(builder);
  return move;
}

UntypedObservation UntypedFrontend::move_to(std::span<const std::uint32_t> actuators,
                                            std::span<const std::byte> states,
                                            const MoveOptions& options, Timeout timeout,
                                            std::span<const std::uint64_t> masks,
                                            const KeepWaiting& keep_waiting) {
  return wait_for_move(start_move(actuators, states, options, masks), timeout, keep_waiting);
}

/// The row of the last iteration of the commands. Throws NotReached if they do not end in time.
UntypedObservation UntypedFrontend::first_row_of(const Move& move, const Deadline& deadline,
                                                 const KeepWaiting& keep_waiting) const {
  UntypedObservation row(link_->description);
  move.batch_.wait_for_row(deadline, keep_waiting);
  move.batch_.throw_unless_completed();
  if (!link_->history.read(move.batch_.last_iteration(), row.bytes())) latest(row.bytes());
  return row;
}

UntypedObservation UntypedFrontend::wait_for_move(const Move& move, Timeout timeout,
                                                  const KeepWaiting& keep_waiting) {
  if (bursting()) return burst_to(move, timeout, keep_waiting);
  const Deadline deadline(timeout);
  const auto give_up = [&](const UntypedObservation& last) {
    std::vector<Miss> misses = move.goal_->misses(last);
    const std::string text = not_reached_text(segment(), misses, move.batch_, timeout);
    throw NotReached(text, move.batch_, std::move(misses), last);
  };
  UntypedObservation row(link_->description);
  try {
    row = first_row_of(move, deadline, keep_waiting);
  } catch (const TimeoutError&) {
    give_up(latest());
  }
  const KeepWaiting guarded = link_->guarded(keep_waiting);
  Poll poll(*link_, guarded);
  while (!move.goal_->misses(row).empty()) {
    if (deadline.over()) give_up(row);
    throw_if_halted(*link_);
    keep_alive();
    poll();
    const Iteration next = row.iteration() + 1;
    if (link_->rows.wait_for_row(next, deadline, guarded) == Waited::timed_out) {
      give_up(row);
    }
    if (!link_->history.read(next, row.bytes())) latest(row.bytes());
  }
  return row;
}

/// Bursts, an iteration at a time, until the robot is at the targets of a move.
UntypedObservation UntypedFrontend::burst_to(const Move& move, Timeout timeout,
                                             const KeepWaiting& keep_waiting) {
  const std::int64_t step = std::max<std::int64_t>(1, period());
  const Iteration last = timeout ? published() + (timeout->count() + step - 1) / step
                                 : std::numeric_limits<Iteration>::max();
  const Timeout each = timeout ? std::max(*timeout, kShortestBurst) : timeout;
  const KeepWaiting guarded = link_->guarded(keep_waiting);
  Poll poll(*link_, guarded);
  BatchBuilder nothing;
  while (true) {
    poll();
    UntypedObservation row = burst_of(link_, nothing, 1, each, keep_waiting, {});
    const bool ended = move.batch_.ended();
    if (ended) move.batch_.throw_unless_completed();
    std::vector<Miss> misses = move.goal_->misses(row);
    if (ended && misses.empty()) return row;
    throw_if_halted(*link_);
    if (row.iteration() < last) continue;
    const std::string text = not_reached_text(segment(), misses, move.batch_, timeout);
    throw NotReached(text, move.batch_, std::move(misses), std::move(row));
  }
}

}  // namespace o80
