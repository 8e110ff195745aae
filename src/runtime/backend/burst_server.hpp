#pragma once

#include <cstdint>

#include "memory/ring/lane_receiver.hpp"
#include "memory/segment/liveness.hpp"
#include "memory/segment/owned_segment.hpp"
#include "memory/segment/signal.hpp"
#include "runtime/backend/burst_grant.hpp"

namespace o80 {

/// Grants the bursts that frontends request of a segment without a controller.
///
/// A batch with anything but a burst is dropped with its lane's other batches: honest frontends do
/// not send it to a segment that is played.
///
/// Writer:   one thread.
/// Readers:  frontends, through the feedback of their lanes.
class BurstServer {
 public:
  explicit BurstServer(const OwnedSegment& segment);

  /// Waits at most `at_most` [ns], and at most kSlice, until an iteration may run; true if it may.
  bool may_begin(std::int64_t at_most) noexcept;
  /// Call it after a row was published. Wakes the sender of the burst with its last row.
  void count(Iteration row, bool wakes_readers) noexcept;

 private:
  void take_bursts() noexcept;
  void take(std::uint32_t lane) noexcept;
  bool is_called_off() const noexcept;
  void end_burst(BurstEnd end) noexcept;

  SegmentView view_;
  LaneReceivers lanes_;
  LaneLiveness liveness_;
  BellWaiter bell_;
  BurstGrant burst_;
  Iteration last_ = -1;  // the newest row
};

}  // namespace o80
