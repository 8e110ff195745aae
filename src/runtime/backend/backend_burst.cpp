// How a burst is granted, counted and ended. See ARCHITECTURE.md, Bursting.

#include "runtime/backend/backend_body.hpp"

namespace o80 {

void UntypedBackend::Body::grant(const StagedBatch& sent, const BatchRecord& batch) noexcept {
  if (schema.head.bursting == 0 || is_of_dead(sent)) return;
  const bool until_ended = (batch.flags & kBurstUntilEnded) != 0;
  burst_.begin(sent.lane, sent.incarnation, batch.id,
               until_ended ? BurstGrant::kUntilEnded : batch.burst);
  journal.burst(sent.lane, batch.id,
                {until_ended ? -1 : batch.burst, sent.had_left ? 0 : sent.incarnation});
  if (sent.had_left || is_called_off()) stop_burst();
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
  if (under_way_) return burst_.shorten();
  end_burst(current - 1, end);
  lanes.look_again();
}

}  // namespace o80
