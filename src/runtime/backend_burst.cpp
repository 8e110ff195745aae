// How a burst is granted, counted and ended. See ARCHITECTURE.md, Bursting.

#include "runtime/backend_body.hpp"

namespace o80 {

void UntypedBackend::Body::grant(const StagedBatch& sent, const BatchRecord& batch) noexcept {
  if (schema.head.bursting == 0 || is_of_dead(sent)) return;
  burst_left_ = (batch.flags & kBurstUntilEnded) != 0 ? kUntilEnded : batch.burst;
  burst_lane_ = sent.lane;
  burst_id_ = batch.id;
  burst_incarnation_ = sent.incarnation;
  if (sent.had_left || is_called_off()) stop_burst();
}

/// True if the sender of the burst has cancelled it or has closed its lane.
bool UntypedBackend::Body::is_called_off() const noexcept {
  const LaneReceiver& lane = lanes[burst_lane_];
  return lane.is_cancelled(burst_id_) || lane.closed() >= burst_incarnation_;
}

void UntypedBackend::Body::count_burst() noexcept {
  if (burst_left_ <= 0) return;
  --burst_left_;
  if (burst_left_ == 0) end_burst(current);
}

void UntypedBackend::Body::end_burst(Iteration row, BurstEnd end) noexcept {
  lanes[burst_lane_].set_burst_done(burst_id_, row, end);
  burst_lane_ = kNobody;
}

/// Ends the burst after the current iteration; between two iterations, at once.
void UntypedBackend::Body::stop_burst(BurstEnd end) noexcept {
  if (!granted()) return;
  burst_left_ = under_way_ ? 1 : 0;
  if (under_way_) return;
  end_burst(current - 1, end);
  lanes.look_again();
}

}  // namespace o80
