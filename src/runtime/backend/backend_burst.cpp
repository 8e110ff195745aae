// How a burst is granted, counted and ended; and direct bursts, which an inline group runs without
// a batch. See src/runtime/README.md#bursts.

#include "runtime/backend/backend_body.hpp"
#include "runtime/backend/direct_burst.hpp"

namespace o80 {

void UntypedBackend::Body::grant(const StagedBatch& sent, const BatchRecord& batch) noexcept {
  if (schema.head.bursting == 0 || is_of_dead(sent)) return;
  const bool until_ended = (batch.flags & kBurstUntilEnded) != 0;
  burst_.begin(sent.lane, sent.incarnation, batch.id,
               until_ended ? BurstGrant::kUntilEnded : batch.burst);
  journal.burst(sent.lane, batch.id,
                {until_ended ? -1 : batch.burst, sent.sender_left ? 0 : sent.incarnation});
  if (sent.sender_left || is_called_off()) stop_burst();
}

/// True if the sender of the burst has cancelled it or has closed its lane.
bool UntypedBackend::Body::is_called_off() const noexcept {
  const LaneReceiver& lane = lanes[burst_.lane()];
  return lane.is_cancelled(burst_.batch()) || lane.closed() >= burst_.incarnation();
}

void UntypedBackend::Body::end_burst(Iteration row, BurstEnd end) noexcept {
  if (burst_.is_direct()) {
    controller.take_back();
    return burst_.end();
  }
  lanes[burst_.lane()].set_burst_done(burst_.batch(), row, end);
  journal.burst_ended(burst_.lane(), burst_.incarnation(), burst_.batch(), row, end);
  burst_.end();
}

/// Ends the burst after the current iteration; between two iterations, at once.
void UntypedBackend::Body::stop_burst(BurstEnd end) noexcept {
  if (!burst_.runs()) return;
  if (is_under_way()) return burst_.shorten();
  end_burst(current - 1, end);
  lanes.rescan();
}

// ------------------------------------------------------------------------------ direct bursts

/// True if nothing but the present frontend of the loop's thread acts: then a direct burst does
/// what a batch would do. Where a journal is written, batches are needed for their entries.
bool UntypedBackend::Body::is_undisturbed() const noexcept {
  const bool alone = recorded_ == nullptr && !journal.is_on() && silence_ == 0;
  const bool calm = !halts.acts() && holder_.is_nobody() && !burst_.runs();
  const bool nothing_waits =
      !staging.busy() && schedule.empty() && !schedule.has_aside() && !running.any();
  return alone && calm && nothing_waits && lanes.are_quiet() &&
         !stop.load(std::memory_order_relaxed);
}

/// As a step that takes a batch: first what has happened since the last iteration.
bool UntypedBackend::Body::begin_direct(const DirectBurst& burst) noexcept {
  watch();
  if (!is_undisturbed() || !controller.has_no_command(burst.targets.actuators)) return false;
  while (!controller.finish_pending()) {
  }
  burst_.begin_direct(burst.iterations);
  DirectTargets targets = burst.targets;
  targets.first = current + burst.delay;
  controller.give(targets);
  return true;
}

/// An iteration of a direct burst.
Step UntypedBackend::Body::step_direct() noexcept {
  poll_liveness();
  watch_halt();
  if (stop.load(std::memory_order_relaxed)) return Step::ended;
  if (!burst_.runs()) return Step::standing;  // cut by the halt
  move(Phase::iterating);
  return Step::run;
}

bool UntypedBackend::begin_direct(const DirectBurst& burst) noexcept {
  return body_->begin_direct(burst);
}

}  // namespace o80
