// How batches reach the controller from the lanes, and statuses go back.
// See ARCHITECTURE.md, The life of a command.

#include <algorithm>
#include <cstring>
#include <optional>

#include "memory/futex.hpp"
#include "runtime/backend_body.hpp"

namespace o80 {

// ------------------------------------------------------------------------------ statuses out

void UntypedBackend::Body::tell(const StatusChange& change) noexcept {
  O80_COUNT(status_told);
  LaneReceiver& lane = lanes[change.lane];
  lane.set_status(change.id,
                  {static_cast<std::uint8_t>(change.status),
                   static_cast<std::uint8_t>(change.reason), change.detail, change.iteration});
  if (is_end(change.status)) lane.flag();
}

void UntypedBackend::Body::changed(const StatusChange& change) noexcept {
  // Completion is reported only after the row is published, so that a killed backend has never
  // reported a command whose row is missing.
  const bool waits = stepping_ && is_end(change.status) && untold_.size() < untold_.capacity();
  if (waits) {
    untold_.push_back(change);
  } else {
    tell(change);
  }
  // a burst that runs until its batch has ended (pulse_to_end)
  if (burst_left_ == kUntilEnded && change.lane == burst_lane_ && change.id == burst_id_ + 1) {
    stop_burst();
  }
}

/// Reports the ends of commands in the last step. If its row will never be published, completed
/// commands are reported as purged (stopped).
void UntypedBackend::Body::tell_of_the_row(bool published) noexcept {
  for (StatusChange& change : untold_) {
    if (!published && (change.status == Status::completed || change.status == Status::limited)) {
      change.status = Status::purged;
      change.reason = Reason::stopped;
    }
    tell(change);
  }
  untold_.clear();
}

void UntypedBackend::Body::freed(std::uint32_t lane, std::uint32_t blocks) noexcept {
  lanes[lane].free(blocks);
}

/// Wakes readers and senders with at most one system call.
void UntypedBackend::Body::wake(bool lanes_wait, bool reader_waits) noexcept {
  Wakes& wakes = segment.view().wakes();
  if (lanes_wait && reader_waits) {
    futex_wake_both(wakes.row_wake, 1, wakes.lane_wake);
  } else if (lanes_wait) {
    futex_wake(wakes.lane_wake, kEverybody);
  } else if (reader_waits) {
    futex_wake(wakes.row_wake, 1);
  }
}

void UntypedBackend::Body::note_failure(std::string_view text) noexcept {
  const std::size_t size = std::min(text.size(), failure.size() - 1);
  std::memcpy(failure.data(), text.data(), size);
  failure[size] = 0;
}

void UntypedBackend::Body::fail(std::string_view text) noexcept {
  note_failure(text);
  stop.store(true, std::memory_order_relaxed);
}

// ------------------------------------------------------------------------------ control

Outcome UntypedBackend::Body::take_control(std::uint32_t lane) noexcept {
  // Batches of other lanes are rejected while a lane has control, so they do not get here. A sender
  // that has closed or lost its lane does not get control.
  if (taking_owner_ == 0 || taking_owner_ != lanes[lane].incarnation()) return {};
  holder_ = lane;
  holder_incarnation_ = taking_owner_;
  return {};
}

Outcome UntypedBackend::Body::release_control(std::uint32_t lane) noexcept {
  if (holder_ == lane && holder_incarnation_ == taking_owner_) holder_ = kNobody;
  return {};
}

// ------------------------------------------------------------------------------ batches in

/// Batches sent for this iteration, or for one that a fresh start jumped over.
void UntypedBackend::Body::take_due() noexcept {
  while (!schedule.empty() && schedule.next().at <= current) {
    const StagedBatch due = schedule.next();
    const Effort effort = controller.effort(due.batch);
    if (!affords(effort)) return;  // the next iteration rejects it as late, or takes it (late_now)
    spend(effort);
    schedule.drop_next();
    if (admit(due)) take(due);
  }
}

/// Takes batches from the lanes within the budget of one iteration.
void UntypedBackend::Body::take_batches() noexcept {
  if (!lanes.look()) return;
  if (lanes.tickets_were_put_back()) {
    controller.forget_tickets();
    halted_below_ = 0;
  }
  const bool all_taken = take_in_order();
  if (granted()) {
    lanes.look_again_after(burst_lane_);
    if (staging.busy()) lanes.look_again();
  } else if (!all_taken) {
    stage_ahead();
    take_express();
  }
}

/// Takes batches in the order of their tickets; false if the budget ended first.
bool UntypedBackend::Body::take_in_order() noexcept {
  // batches sent after a burst are taken after it
  while (!granted()) {
    const std::optional<std::uint32_t> lane = lanes.next(staging.tickets());
    if (!lane) return true;
    if (!staging.has_staged(*lane) && !stage(*lane, share_.work)) return false;
    if (staging.has_staged(*lane) && !take_staged(*lane)) return false;
  }
  return true;
}

/// Stages a few blocks of every lane ahead of its turn, so that express batches behind other
/// batches are found.
void UntypedBackend::Body::stage_ahead() noexcept {
  std::uint32_t left = kWorkAheadOfAll;
  for (std::uint32_t i = 0; i < lanes.size() && left > 0; ++i) {
    const std::uint32_t lane = ahead_from_ = (ahead_from_ + 1) % lanes.size();
    const std::uint32_t share = std::min(kWorkAhead, left);
    std::uint32_t budget = share;
    while (!staging.is_between_batches(lane) ||
           (lanes.has_batch(lane) && !staging.next_is_express(lane))) {
      if (!stage(lane, budget)) break;
    }
    left -= share - budget;
  }
}

/// Takes express batches, which would otherwise wait for batches of other lanes.
void UntypedBackend::Body::take_express() noexcept {
  std::uint32_t work = 0;
  do {
    express_lanes_.clear();
    for (std::uint32_t i = 0; i < lanes.size(); ++i) {
      if (staging.is_between_batches(i) && lanes.has_batch(i) && staging.next_is_express(i)) {
        express_lanes_.push_back(i);
      }
    }
    std::ranges::sort(express_lanes_, {}, [&](std::uint32_t i) {
      return lanes[i].peek_word(offsetof(BatchRecord, ticket));
    });
    for (const std::uint32_t lane : express_lanes_) {
      mourn(lane, lanes[lane].dead_predecessor());
      const std::optional<StagedBatch> batch = staging.express(lane);
      work += kMostExpressRecords;
      if (!batch) continue;
      work += controller.effort(batch->batch).work;
      accept(*batch);
    }
  } while (!express_lanes_.empty() && work < kExpressWork);
}

/// Stages the next batch of a lane; false if the budget ended first.
bool UntypedBackend::Body::stage(std::uint32_t lane, std::uint32_t& budget) noexcept {
  // the death of an owner is handled before the first batch of its successor
  if (staging.is_between_batches(lane)) mourn(lane, lanes[lane].dead_predecessor());
  return staging.go_on(lane, budget);
}

bool UntypedBackend::Body::take_staged(std::uint32_t lane) noexcept {
  const StagedBatch next = staging.front(lane);
  const Effort effort = controller.effort(next.batch);
  if (!affords(effort)) return false;
  spend(effort);
  staging.pop(lane);
  accept(next);
  return true;
}

bool UntypedBackend::Body::affords(const Effort& effort) const noexcept {
  return share_.work > 0 && effort.requests <= share_.requests;
}

void UntypedBackend::Body::spend(const Effort& effort) noexcept {
  share_.work -= std::min(share_.work, effort.work);
  share_.requests -= effort.requests;
}

/// Takes a batch, schedules it for its iteration, or rejects it.
void UntypedBackend::Body::accept(const StagedBatch& sent) noexcept {
  break_silence(sent.lane);
  if (!suits_halt(sent)) return;
  const BatchRecord batch = pool.batch(sent.batch);
  const bool bursts = batch.burst > 0 || (batch.flags & kBurstUntilEnded) != 0;
  const bool is_for_later = sent.at > current;
  StagedBatch due = sent;
  if (due.at < 0) due.at = current;
  // Control is checked when a batch is taken. The burst of a scheduled batch starts now, so it is
  // checked now as well.
  if (!is_for_later || bursts) {
    if (!admit(due)) return;
  } else if (stale_ == Stale::purge && is_of_dead(due)) {
    reject(due, Reason::dead_frontend);
    return;
  }
  if (is_for_later && !schedule.has_room(due.lane, due.at)) {
    reject(due, Reason::full);
    return;
  }
  if (bursts) grant(due, batch);
  if (is_for_later) {
    schedule.add(due);
  } else {
    take(due);
  }
}

void UntypedBackend::Body::take(const StagedBatch& sent) noexcept {
  O80_COUNT(batch_taken);
  taking_owner_ = sent.had_left ? 0 : sent.incarnation;
  // if the ticket counter was reset since the batch was staged, a purge with the old ticket would
  // end batches that are sent from now on
  pool.batch(sent.batch).ticket = lanes.drawn_at_most(sent.ticket);
  controller.take(sent.lane, sent.batch, *this);
}

/// True if a batch may be taken in this iteration; otherwise ends it.
bool UntypedBackend::Body::admit(const StagedBatch& sent) noexcept {
  if (!suits_halt(sent) || ends_for_silence(sent)) return false;
  watch_holder();
  const std::uint64_t sender = sent.had_left ? 0 : sent.incarnation;
  const bool is_holders = holder_ == sent.lane && holder_incarnation_ == sender;
  // control covers commands only: any commander may resume
  const bool is_free = holder_ == kNobody || controller.effort(sent.batch).resumes;
  if (!is_free && !is_holders) return reject(sent, Reason::exclusive, holder_);
  if (sent.at < current && !sent.late_now) return reject(sent, Reason::late);
  if (stale_ == Stale::purge && is_of_dead(sent)) return reject(sent, Reason::dead_frontend);
  return true;
}

bool UntypedBackend::Body::is_of_dead(const StagedBatch& sent) noexcept {
  const LaneLife& life = lives_[sent.lane];
  return sent.of_dead || (sent.incarnation != 0 && sent.incarnation <= mourned_[sent.lane]) ||
         (life.state == LaneState::died && life.incarnation == lanes[sent.lane].incarnation());
}

bool UntypedBackend::Body::reject(const StagedBatch& sent, Reason reason,
                                  std::uint32_t detail) noexcept {
  controller.reject(sent.lane, sent.batch, reason, static_cast<std::uint8_t>(detail), current);
  return false;
}

void UntypedBackend::Body::reject_all(Reason reason) noexcept {
  for (; !schedule.empty(); schedule.drop_next()) reject(schedule.next(), reason);
  while (schedule.has_aside()) reject(schedule.take_aside(), reason);
  for (std::uint32_t lane = 0; lane < lanes.size(); ++lane) {
    for (; staging.has_staged(lane); staging.pop(lane)) reject(staging.front(lane), reason);
  }
}

}  // namespace o80
