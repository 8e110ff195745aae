// How a frontend requests iterations, of one backend or of several.
// See src/runtime/README.md#bursts.

#include <algorithm>
#include <limits>
#include <set>

#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/frontend/sending.hpp"

namespace o80 {

namespace {

/// Cancels the rest of a burst if its caller leaves without the last row.
class CancelUnlessDone {
 public:
  CancelUnlessDone(LaneSender* lane, CommandId id) : lane_(lane), id_(id) {}
  CancelUnlessDone& operator=(CancelUnlessDone&&) = delete;
  ~CancelUnlessDone() {
    if (lane_ != nullptr) lane_->cancel_burst(id_);
  }
  void done() noexcept { lane_ = nullptr; }

 private:
  LaneSender* lane_;
  CommandId id_;
};

void refuse_burst(const Link& link, std::int64_t iterations) {
  link.check_usable();
  const std::string& segment = link.segment.name();
  if (link.description->schema.head.bursting == 0) {
    throw NotBursting("'" + segment +
                      (is_played(link.segment)
                           ? "' is played by time: play the recording with --bursts"
                           : "' runs in real time and cannot be burst: start it with bursting"));
  }
  if (iterations < 1) {
    throw InvalidArgument("the iterations of a burst of '" + segment +
                          "' must be at least 1, got " + std::to_string(iterations));
  }
}

Sent send_burst(Link& link, BatchBuilder& builder, std::int64_t iterations,
                const PulseOptions& options, Statuses statuses) {
  refuse_burst(link, iterations);
  BatchRecord record = batch_of(options);
  record.burst = iterations;
  return send(link, builder, record, options.seen, statuses);
}

/// Sends a burst, calls `meanwhile`, and waits; returns the iteration of its last row. As
/// start_burst(iterations).wait(timeout, keep_waiting), without the allocations of a Burst.
template <class Meanwhile>
Iteration run_burst(const std::shared_ptr<Link>& link, BatchBuilder& builder,
                    std::int64_t iterations, Timeout timeout, const KeepWaiting& keep_waiting,
                    const PulseOptions& options, Meanwhile&& meanwhile) {
  const Sent sent = send_burst(*link, builder, iterations, options, Statuses::unread);
  CancelUnlessDone rest(sent.lane.get(), sent.id);
  meanwhile();
  const Iteration last =
      wait_for_burst(*link, *sent.lane, sent.id, timeout, keep_waiting, sent.events_before_send);
  rest.done();
  link->check_usable();  // a close of this frontend ends its burst too
  if (last < 0) Burst(link, Batch(link, sent)).wait(timeout, keep_waiting);  // says why
  return last;
}

/// Throws what start_burst would throw, or if the backend has gone, as far as it can be known now.
void refuse_unless_ready(Link& link, std::int64_t iterations, const std::optional<Seen>& seen) {
  refuse_burst(link, iterations);
  const auto lock = link.lock_to_send();
  link.segment.throw_if_gone();
  BatchRecord wanted;
  wanted.burst = iterations;
  refuse_unless_sendable(link, link.builder, wanted, seen);
}

}  // namespace

UntypedObservation UntypedFrontend::pulse_and_wait(Timeout timeout, const PulseOptions& options,
                                                   const KeepWaiting& keep_waiting,
                                                   const WaitOptions& wait) {
  return wait_for_end(pulse_to_end(options), timeout, keep_waiting, wait);
}

UntypedObservation UntypedFrontend::wait_for_end(const Batch& batch, Timeout timeout,
                                                 const KeepWaiting& keep_waiting,
                                                 const WaitOptions& options) const {
  UntypedObservation observation(link_->description);
  const Iteration last = wait_until_ended(batch, timeout, keep_waiting);
  if (batch.id() == 0) link_->segment.throw_if_gone();  // its newest row would look like an answer
  if (batch.id() != 0 && options.check) batch.throw_unless_completed();
  if (last < 0 && batch.rejected_by() == Reason::stopped) throw_rejected(*link_, "batch", batch);
  if (last < 0 || !link_->history.read(last, observation.bytes())) latest(observation.bytes());
  return observation;
}

Iteration UntypedFrontend::wait_until_ended(const Batch& batch, Timeout timeout,
                                            const KeepWaiting& keep_waiting) const {
  if (batch.id() == 0 || !bursting()) {
    batch.wait(timeout, keep_waiting, {.check = false});
    return batch.last_iteration();
  }
  CancelUnlessDone rest(batch.lane_.get(), batch.id());
  const Iteration last = Burst(link_, batch).wait_done(timeout, keep_waiting);
  rest.done();
  link_->check_usable();
  return last;
}

Burst UntypedFrontend::start_burst(std::int64_t iterations, const PulseOptions& options) {
  return {link_,
          Batch(link_, send_burst(*link_, link_->builder, iterations, options, Statuses::noted))};
}

UntypedObservation UntypedFrontend::burst(std::int64_t iterations, Timeout timeout,
                                          const KeepWaiting& keep_waiting,
                                          const PulseOptions& options) {
  return burst_of(link_, link_->builder, iterations, timeout, keep_waiting, options);
}

UntypedObservation burst_of(const std::shared_ptr<Link>& link, BatchBuilder& builder,
                            std::int64_t iterations, Timeout timeout,
                            const KeepWaiting& keep_waiting, const PulseOptions& options) {
  std::optional<UntypedObservation> observation;
  const Iteration last = run_burst(link, builder, iterations, timeout, keep_waiting, options,
                                   [&] { observation.emplace(link->description); });
  read_last_row(*link, last, *observation);
  return *std::move(observation);
}

Iteration UntypedFrontend::burst_rows(std::span<std::byte> rows, Timeout timeout,
                                      const KeepWaiting& keep_waiting,
                                      const PulseOptions& options) {
  const std::size_t count = rows.size() / layout().size;
  if (count > link_->history.rows()) {
    throw InvalidArgument("the " + std::to_string(count) + " rows of a burst of '" + segment() +
                          "' do not fit into its history of " +
                          std::to_string(link_->history.rows()));
  }
  const Iteration last = run_burst(link_, link_->builder, static_cast<std::int64_t>(count), timeout,
                                   keep_waiting, options, [] {});
  const Iteration first = last + 1 - static_cast<Iteration>(count);
  if (link_->history.read_range(first, count, rows.data()).count != count) {
    throw RowOverwritten("rows " + std::to_string(first) + " to " + std::to_string(last) + " of '" +
                         segment() + "', of this burst, were overwritten: use a longer history");
  }
  return last;
}

// ------------------------------------------------------------------------------ groups

std::vector<Burst> start_bursts(std::span<const BurstMember> group,
                                const std::optional<Seen>& seen) {
  std::set<const Link*> members;
  for (const auto& [frontend, iterations] : group) {
    refuse_unless_ready(*frontend->link(), iterations, seen);
    if (!members.insert(frontend->link().get()).second) {
      throw InvalidArgument("the frontend of '" + frontend->segment() +
                            "' is in the group twice: give each frontend once");
    }
  }
  std::vector<Burst> bursts;
  bursts.reserve(group.size());
  try {
    for (const auto& [frontend, iterations] : group) {
      bursts.push_back(frontend->start_burst(iterations, {.seen = seen}));
    }
  } catch (...) {
    // another thread has used the free blocks, or a backend has just gone
    std::ranges::for_each(bursts, &Burst::cancel);
    throw;
  }
  return bursts;
}

std::vector<UntypedObservation> wait_for(std::span<const Burst> bursts, Timeout timeout,
                                         const KeepWaiting& keep_waiting) {
  const Deadline deadline(timeout);
  const auto left = [&] {
    return timeout ? Timeout(std::chrono::nanoseconds(
                         deadline.left(std::numeric_limits<std::int64_t>::max())))
                   : Timeout();
  };
  // a later member may fail during the wait for an earlier one
  const auto check_all = [&] { std::ranges::for_each(bursts, &Burst::throw_if_failed); };
  const KeepWaiting watch = [&] {
    check_all();
    return !keep_waiting || keep_waiting();
  };
  std::vector<UntypedObservation> observations;
  observations.reserve(bursts.size());
  try {
    for (const Burst& burst : bursts) {
      try {
        observations.push_back(burst.wait(left(), watch));
      } catch (const TimeoutError&) {
        check_all();  // prefer a failure over the timeout
        throw;
      }
    }
  } catch (...) {
    std::ranges::for_each(bursts, &Burst::cancel);
    throw;
  }
  return observations;
}

std::vector<UntypedObservation> burst(std::span<const BurstMember> group, Timeout timeout,
                                      const KeepWaiting& keep_waiting) {
  const std::vector<Burst> bursts = start_bursts(group);
  return wait_for(bursts, timeout, keep_waiting);
}

}  // namespace o80
