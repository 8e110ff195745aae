// How batches reach the controller from the lanes, and statuses go back.
// See ARCHITECTURE.md#a-commands-way and src/control/README.md#order.

#include <algorithm>
#include <cstring>
#include <optional>

#include "runtime/backend/backend_body.hpp"

namespace o80 {

// ------------------------------------------------------------------------------ statuses out

void UntypedBackend::Body::changed(const StatusChange& change) noexcept {
  if (change.of == StatusChange::Of::batch && deciding_ != nullptr) {
    journal.decided(*deciding_, change);
  }
  outbox_.put(change);
  // a burst that runs until its batch has ended (pulse_to_end)
  if (burst_.ends_with(change.lane, change.id)) stop_burst();
}

void UntypedBackend::Body::freed(std::uint32_t lane, std::uint32_t blocks) noexcept {
  lanes[lane].free(blocks);
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
  holder_.take(lane, taking_owner_);
  journal.control(JournalKind::control_taken, lane, taking_owner_);
  return {};
}

Outcome UntypedBackend::Body::release_control(std::uint32_t lane) noexcept {
  if (!holder_.is(lane, taking_owner_)) return {};
  holder_.release();
  journal.control(JournalKind::control_released, lane, taking_owner_);
  return {};
}

// ------------------------------------------------------------------------------ batches in

/// Batches sent for this iteration, or for one that a fresh start jumped over.
void UntypedBackend::Body::take_all_due() noexcept {
  while (!schedule.empty() && schedule.next().at <= current) {
    const StagedBatch due = schedule.next();
    const Effort effort = controller.effort(due.batch);
    // the next iteration rejects it as late, or takes it (late_now)
    if (!share_.affords(effort)) return;
    share_.spend(effort);
    queue_.spent(due.lane, effort.work);
    schedule.drop_next();
    if (admit(due)) take(due);
  }
}

/// Takes batches from the lanes within the budget of one iteration.
void UntypedBackend::Body::take_batches() noexcept {
  if (!lanes.poll()) {
    if (!burst_.runs()) queue_.is_empty();
    return;
  }
  if (lanes.tickets_were_put_back()) {
    controller.forget_tickets();
    journal.order_lost();
    halted_below_ = 0;
  }
  const bool all_taken = take_in_order();
  if (burst_.runs()) {
    queue_.bursts(burst_.lane(), current);
    lanes.rescan_after(burst_.lane());
    if (staging.busy()) lanes.rescan();
  } else if (all_taken) {
    queue_.is_empty();
  } else {
    queue_.waits(current);
    stage_ahead();
    take_express();
  }
}

/// Takes batches in the order of their tickets; false if the budget ended first.
bool UntypedBackend::Body::take_in_order() noexcept {
  // batches sent after a burst are taken after it
  while (!burst_.runs()) {
    const std::optional<std::uint32_t> lane = lanes.next(staging.tickets());
    if (!lane) return true;
    const std::uint32_t before = share_.work;
    const bool continues = (staging.has_staged(*lane) || stage(*lane, share_.work)) &&
                           (!staging.has_staged(*lane) || take_staged(*lane));
    queue_.spent(*lane, before - share_.work);
    if (!continues) return false;
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
      on_owner_death(lane, lanes[lane].dead_predecessor());
      const std::optional<StagedBatch> batch = staging.express(lane);
      work += kMaxExpressRecords;
      if (!batch) continue;
      work += controller.effort(batch->batch).work;
      accept(*batch);
    }
  } while (!express_lanes_.empty() && work < kExpressWork);
}

/// Stages the next batch of a lane; false if the budget ended first.
bool UntypedBackend::Body::stage(std::uint32_t lane, std::uint32_t& budget) noexcept {
  // the death of an owner is handled before the first batch of its successor
  if (staging.is_between_batches(lane)) on_owner_death(lane, lanes[lane].dead_predecessor());
  return staging.advance(lane, budget);
}

bool UntypedBackend::Body::take_staged(std::uint32_t lane) noexcept {
  const StagedBatch next = staging.front(lane);
  const Effort effort = controller.effort(next.batch);
  if (!share_.affords(effort)) return false;
  share_.spend(effort);
  staging.pop(lane);
  accept(next);
  return true;
}

/// Takes a batch, schedules it for its iteration, or rejects it.
void UntypedBackend::Body::accept(const StagedBatch& sent) noexcept {
  note_life(sent.lane);
  // A process may have halted and then sent this batch since the step has begun. The halt begins
  // before the batch, or its resume would find no halt in force and do nothing.
  if (halts.poll()) begin_halt();
  if (!admitted_during_halt(sent)) return;
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
    journal.scheduled(due, batch.id);
    schedule.add(due);
  } else {
    take(due);
  }
}

void UntypedBackend::Body::take(const StagedBatch& sent) noexcept {
  O80_COUNT(batch_taken);
  // if the ticket counter was reset since the batch was staged, a purge with the old ticket would
  // end batches that are sent from now on
  StagedBatch taken = sent;
  taken.ticket = lanes.drawn_at_most(sent.ticket);
  pool.batch(sent.batch).ticket = taken.ticket;
  take_checked(taken);
}

void UntypedBackend::Body::take_checked(const StagedBatch& sent) noexcept {
  taking_owner_ = sent.sender_left ? 0 : sent.incarnation;
  deciding_ = &sent;
  if (pool.batch(sent.batch).records > 0) journal.acts();
  controller.take(sent.lane, sent.batch, *this);
  deciding_ = nullptr;
}

/// True if a batch may be taken in this iteration; otherwise ends it.
bool UntypedBackend::Body::admit(const StagedBatch& sent) noexcept {
  if (!admitted_during_halt(sent) || ends_for_silence(sent)) return false;
  watch_holder();
  const std::uint64_t sender = sent.sender_left ? 0 : sent.incarnation;
  const bool is_holders = holder_.is(sent.lane, sender);
  // control covers commands only: any commander may resume and mark
  const bool is_free = holder_.is_nobody() || controller.effort(sent.batch).free;
  if (!is_free && !is_holders) return reject(sent, Reason::exclusive, holder_.lane());
  if (sent.at < current && !sent.late_now) return reject(sent, Reason::late);
  if (stale_ == Stale::purge && is_of_dead(sent)) return reject(sent, Reason::dead_frontend);
  return admitted_by_followers(sent);
}

bool UntypedBackend::Body::is_of_dead(const StagedBatch& sent) noexcept {
  const LaneLife& life = lives_[sent.lane];
  return sent.of_dead ||
         (sent.incarnation != 0 && sent.incarnation <= handled_deaths_[sent.lane]) ||
         (life.state == LaneState::died && life.incarnation == lanes[sent.lane].incarnation());
}

bool UntypedBackend::Body::reject(const StagedBatch& sent, Reason reason,
                                  std::uint32_t detail) noexcept {
  end_batch(sent, reason, static_cast<std::uint8_t>(detail), Status::rejected);
  return false;
}

/// Rejects a batch; its records end with `status`.
void UntypedBackend::Body::end_batch(const StagedBatch& sent, Reason reason, std::uint8_t detail,
                                     Status status) noexcept {
  deciding_ = &sent;
  controller.reject(sent.lane, sent.batch, reason, detail, current, status);
  deciding_ = nullptr;
}

void UntypedBackend::Body::reject_all(Reason reason) noexcept {
  for (; !schedule.empty(); schedule.drop_next()) reject(schedule.next(), reason);
  while (schedule.has_aside()) reject(schedule.take_aside(), reason);
  for (std::uint32_t lane = 0; lane < lanes.size(); ++lane) {
    for (; staging.has_staged(lane); staging.pop(lane)) reject(staging.front(lane), reason);
  }
}

}  // namespace o80
