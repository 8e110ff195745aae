// How a frontend halts, resumes, gives signs of life and reads running requests.
// See src/runtime/README.md#halts.

#include "base/printable.hpp"
#include "memory/segment/running_slot.hpp"
#include "memory/segment/segment_file.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"

namespace o80 {

std::uint64_t UntypedFrontend::halt(std::string_view reason) {
  link_->check_usable();
  if (link_->segment.access() != Access::read_write) {
    throw ReadOnly("'" + segment() + "' was attached with read_only: attach without it to halt");
  }
  refuse_if_played(link_->segment);
  link_->segment.throw_if_gone();
  const std::uint64_t number =
      request_halt(link_->segment.view(), HaltCause::frontend, own_process(), reason);
  // A successor inherits this halt, or it had marked the segment as superseded before: then throw.
  // See src/memory/README.md#successor.
  link_->segment.throw_if_gone();
  // an inline robot begins the halt now, unless this thread is inside a burst, which does it
  std::shared_ptr<InlineRunner> runner;
  {
    const std::scoped_lock lock(link_->sending);
    runner = link_->runner;
  }
  if (runner && !runner->runs_here()) runner->run();
  return number;
}

std::optional<Halt> UntypedFrontend::halted() const {
  link_->check_usable();
  return link_->halt();
}

bool UntypedFrontend::resume(std::uint64_t number, Timeout timeout, const KeepWaiting& keep_waiting,
                             bool accept_reading) {
  // one wrong reading need not refuse it
  constexpr int kReadings = 5;
  int readings = 0;
  link_->check_usable();
  refuse_if_played(link_->segment);
  link_->segment.throw_if_gone();
  if (!link_->halt()) return false;
  const Deadline deadline(timeout);
  while (true) {
    wait_for_rest(number, deadline, keep_waiting);
    BatchBuilder builder;
    builder.resume(number, accept_reading);
    const Batch batch = pulse(builder);
    batch.wait_for_row(deadline, keep_waiting);
    const Handle handle = batch.handle(0);
    if (handle.status == Status::completed) return true;
    // at rest, the backend may still have scheduled batches to end
    const std::optional<Halt> acting = link_->halt();
    const bool is_misread = handle.reason == Reason::reading && ++readings <= kReadings;
    const bool is_early = !bursting() && (handle.reason == Reason::halted || is_misread) &&
                          acting && acting->number == number && !deadline.over();
    if (!is_early) {
      throw BackendHalted("'" + segment() + "' does not resume: " + handle.text);
    }
    link_->rows.wait_for_row(published() + 1, deadline, link_->guarded(keep_waiting));
  }
}

/// In real time: waits until the rows show that the halt is in force and no actuator brakes.
/// Returns at once if another halt, or none, is in force: the backend then answers with the reason.
void UntypedFrontend::wait_for_rest(std::uint64_t number, const Deadline& deadline,
                                    const KeepWaiting& keep_waiting) {
  link_->check_usable();
  if (bursting()) return;
  // rows may come so fast that wait_for_row never calls keep_waiting: call it here
  const KeepWaiting continues = link_->guarded(keep_waiting);
  while (true) {
    const bool is_called_off = !continues();
    const std::optional<Halt> acting = link_->halt();
    if (!acting || acting->number != number) return;
    const bool is_latched = acting->iteration >= 0;
    Iteration next = published() + 1;
    if (is_latched && published() >= acting->iteration) {
      const UntypedObservation row = latest();
      if (!row.any_braking()) return;
      next = row.iteration() + 1;
    }
    if (is_called_off || link_->rows.wait_for_row(next, deadline, continues) == Waited::timed_out) {
      throw TimeoutError("halt " + std::to_string(number) + " of '" + segment() + "' " +
                         (is_latched ? "still brakes the robot" : "is not in force yet") +
                         ": pass a longer timeout to resume");
    }
  }
}

std::vector<RequestUnderWay> UntypedFrontend::running_requests() const {
  link_->check_usable();
  std::vector<RequestUnderWay> all;
  for (const RunningRequest& each : o80::running_requests(link_->segment.view())) {
    if (each.request >= schema().requests.size()) continue;  // garbage
    all.push_back({schema().requests[each.request].name.str(), each.since,
                   printable(each.who_text()), printable(each.progress_text())});
  }
  return all;
}

void UntypedFrontend::keep_alive() {
  link_->check_usable();
  if (const auto lane = link_->lane_if_taken()) lane->show_life();
}

std::uint64_t halt(const std::string& segment, std::string_view reason, Timeout timeout,
                   const KeepWaiting& keep_waiting) {
  AttachOptions options;
  options.keep_waiting = keep_waiting;
  options.starting = true;
  const Deadline deadline(timeout);
  while (true) {
    const AttachedSegment attached =
        AttachedSegment::attach(segment, Access::read_write, deadline, options);
    refuse_if_played(attached);
    const std::uint64_t number =
        request_halt(attached.view(), HaltCause::frontend, own_process(), reason);
    // a successor is taking the name: halt that one
    if (attached.life() == Life::superseded) continue;
    attached.throw_if_gone();
    return number;
  }
}

}  // namespace o80
