#pragma once

#include "runtime/backend/backend_core.hpp"
#include "runtime/backend/burst_grant.hpp"

namespace o80 {

/// Begins, counts and ends the burst of a bursting backend. See src/runtime/README.md#bursts.
///
/// Realtime: yes.
class Bursts : public BurstGrant {
 public:
  explicit Bursts(BackendCore& core) : core_(core) {}

  bool is_granted() const noexcept { return core_.schema.head.bursting == 0 || runs(); }
  /// Begins the burst that a batch requests.
  void grant(const StagedBatch& sent, const BatchRecord& record) noexcept {
    if (core_.schema.head.bursting == 0) return;
    const bool until_ended = (record.flags & kBurstUntilEnded) != 0;
    begin(sent.lane, sent.incarnation, record.id, until_ended ? kUntilEnded : record.burst);
    core_.journal.burst(sent.lane, record.id,
                        {until_ended ? -1 : record.burst, sent.sender_left ? 0 : sent.incarnation});
    if (sent.sender_left || is_called_off()) stop();
  }
  /// True if the sender of the burst has cancelled it or has closed its lane.
  bool is_called_off() const noexcept {
    const LaneReceiver& sender = core_.lanes[lane()];
    return sender.is_cancelled(batch()) || sender.closed() >= incarnation();
  }
  /// Ends the burst after the current iteration; between two iterations, at once.
  void stop(BurstEnd end = BurstEnd::done) noexcept {
    if (!runs()) return;
    if (core_.is_under_way()) return shorten();
    end_at(core_.current - 1, end);
    core_.lanes.rescan();
  }
  void count_iteration() noexcept {
    if (count()) end_at(core_.current, BurstEnd::done);
  }

 private:
  void end_at(Iteration row, BurstEnd how) noexcept {
    if (is_direct()) {
      core_.controller.take_back();
    } else {
      core_.lanes[lane()].set_burst_done(batch(), row, how);
      core_.journal.burst_ended(lane(), incarnation(), batch(), row, how);
    }
    end();
  }

  BackendCore& core_;
};

}  // namespace o80
