#include "runtime/backend/burst_server.hpp"

#include <algorithm>
#include <cstddef>

#include "o80/describe/describe.hpp"

namespace o80 {

BurstServer::BurstServer(const OwnedSegment& segment)
    : view_(segment.view()),
      lanes_(segment.view(), offsetof(BatchRecord, ticket)),
      liveness_(segment),
      bell_(segment.view()) {}

bool BurstServer::may_begin(std::int64_t at_most) noexcept {
  if (burst_.runs() && is_called_off()) end_burst(BurstEnd::done);
  if (!burst_.runs()) take_bursts();
  if (!burst_.runs()) {
    wake_sleepers(view_, {.lanes = lanes_.announce()});
    bell_.wait(lanes_.bell_seen(), std::min(at_most, kSlice));
    lanes_.rescan();  // also if the bell is damaged
    take_bursts();
  }
  return burst_.runs();
}

void BurstServer::count(Iteration row, bool wakes_readers) noexcept {
  last_ = row;
  if (burst_.count()) end_burst(BurstEnd::done);
  wake_sleepers(view_, {.lanes = lanes_.announce(), .rows = wakes_readers});
}

/// Takes batches in the order of their pulses until one grants a burst.
void BurstServer::take_bursts() noexcept {
  if (!lanes_.poll()) return;
  while (!burst_.runs()) {
    const auto lane = lanes_.next();
    if (!lane) return;
    take(*lane);
  }
}

void BurstServer::take(std::uint32_t lane) noexcept {
  LaneReceiver& from = lanes_[lane];
  const bool sender_left = from.owner_of_next() == 0 || from.next_is_of_dead();
  const std::uint64_t incarnation = from.incarnation();
  Block block{};
  const bool taken = from.available_of_one() > 0 && from.take(block.bytes.data());
  const auto batch = unpack<BatchRecord>(block.bytes.data());
  const bool is_burst = taken && batch.kind == RecordKind::batch && batch.blocks == 1 &&
                        batch.records == 0 && batch.burst > 0 && from.expects(batch.id);
  if (taken) from.free(1);
  if (!is_burst) return from.reset();
  from.note_ids(record_id(batch.id, 0));
  const auto status = [](Status value, Iteration at) {
    return StatusWord{.status = static_cast<std::uint8_t>(value), .iteration = at};
  };
  from.set_status(batch.id, status(Status::active, last_ + 1));
  from.set_status(batch.id + 1, status(Status::completed, last_ + 1));
  burst_.begin(lane, incarnation, batch.id, batch.burst);
  if (sender_left || is_called_off()) end_burst(BurstEnd::done);
}

/// True if the sender of the burst has cancelled it, has closed its lane, or has died.
bool BurstServer::is_called_off() const noexcept {
  const LaneReceiver& lane = lanes_[burst_.lane()];
  const LaneLife life = liveness_.lane(burst_.lane());
  const bool has_died = life.state == LaneState::died && life.incarnation >= burst_.incarnation();
  return has_died || lane.is_cancelled(burst_.batch()) || lane.closed() >= burst_.incarnation() ||
         lane.incarnation() != burst_.incarnation();
}

void BurstServer::end_burst(BurstEnd end) noexcept {
  lanes_[burst_.lane()].set_burst_done(burst_.batch(), last_, end);
  burst_.end();
}

}  // namespace o80
