#include "runtime/backend/intake.hpp"

#include <algorithm>
#include <optional>

namespace o80 {

namespace {

// budget for staging ahead, so that purges behind other batches are found: of a lane, of all lanes
constexpr std::uint32_t kWorkAhead = 64;
constexpr std::uint32_t kWorkAheadOfAll = 512;
/// Budget for express batches; in each iteration every lane may have one taken in any case.
constexpr std::uint32_t kExpressWork = 512;

}  // namespace

Intake::Intake(BackendCore& core, Bursts& bursts, Readings& readings, Halts& halts,
               Commanders& commanders, BatchHandler& handler)
    : core_(core),
      bursts_(bursts),
      readings_(readings),
      halts_(halts),
      commanders_(commanders),
      handler_(handler),
      staging_(core.lanes, core.pool, core.controller, core.journal),
      queue_(core.segment.view()) {
  express_lanes_.reserve(core.lanes.size());
}

void Intake::take_all_due() noexcept {
  while (!core_.schedule.empty() && core_.schedule.next().at <= core_.current) {
    const StagedBatch due = core_.schedule.next();
    const Effort effort = core_.controller.effort(due.batch);
    // the next iteration rejects it as late, or takes it (late_now)
    if (!share_.affords(effort)) return;
    share_.spend(effort);
    queue_.spent(due.lane, effort.work);
    core_.schedule.drop_next();
    if (admit(due)) take(due);
  }
}

void Intake::take_new() noexcept {
  if (!core_.lanes.poll()) {
    if (!bursts_.runs()) queue_.is_empty();
    return;
  }
  if (core_.lanes.tickets_were_put_back()) {
    core_.controller.forget_tickets();
    core_.journal.order_lost();
    halts_.forget_tickets();
  }
  const bool all_taken = take_in_order();
  if (bursts_.runs()) {
    queue_.bursts(bursts_.lane(), core_.current);
    core_.lanes.rescan_after(bursts_.lane());
    if (staging_.busy()) core_.lanes.rescan();
  } else if (all_taken) {
    queue_.is_empty();
  } else {
    queue_.waits(core_.current);
    stage_ahead();
    take_express();
  }
}

/// Takes batches in the order of their tickets; false if the budget ended first.
bool Intake::take_in_order() noexcept {
  // batches sent after a burst are taken after it
  while (!bursts_.runs()) {
    const std::optional<std::uint32_t> lane = core_.lanes.next(staging_.tickets());
    if (!lane) return true;
    const std::uint32_t before = share_.work;
    const bool continues = (staging_.has_staged(*lane) || stage(*lane, share_.work)) &&
                           (!staging_.has_staged(*lane) || take_staged(*lane));
    queue_.spent(*lane, before - share_.work);
    if (!continues) return false;
  }
  return true;
}

/// Stages a few blocks of every lane ahead of its turn, so that express batches behind other
/// batches are found.
void Intake::stage_ahead() noexcept {
  std::uint32_t left = kWorkAheadOfAll;
  for (std::uint32_t i = 0; i < core_.lanes.size() && left > 0; ++i) {
    const std::uint32_t lane = ahead_from_ = (ahead_from_ + 1) % core_.lanes.size();
    const std::uint32_t share = std::min(kWorkAhead, left);
    std::uint32_t budget = share;
    while (!staging_.is_between_batches(lane) ||
           (core_.lanes.has_batch(lane) && !staging_.next_is_express(lane))) {
      if (!stage(lane, budget)) break;
    }
    left -= share - budget;
  }
}

/// Takes express batches, which would otherwise wait for batches of other lanes.
void Intake::take_express() noexcept {
  std::uint32_t work = 0;
  do {
    express_lanes_.clear();
    for (std::uint32_t i = 0; i < core_.lanes.size(); ++i) {
      if (staging_.is_between_batches(i) && core_.lanes.has_batch(i) &&
          staging_.next_is_express(i)) {
        express_lanes_.push_back(i);
      }
    }
    std::ranges::sort(express_lanes_, {}, [&](std::uint32_t i) {
      return core_.lanes[i].peek_word(offsetof(BatchRecord, ticket));
    });
    for (const std::uint32_t lane : express_lanes_) {
      commanders_.on_owner_death(lane, core_.lanes[lane].dead_predecessor());
      const std::optional<StagedBatch> batch = staging_.express(lane);
      work += kMaxExpressRecords;
      if (!batch) continue;
      work += core_.controller.effort(batch->batch).work;
      accept(*batch);
    }
  } while (!express_lanes_.empty() && work < kExpressWork);
}

bool Intake::stage(std::uint32_t lane, std::uint32_t& budget) noexcept {
  // the death of an owner is handled before the first batch of its successor
  if (staging_.is_between_batches(lane))
    commanders_.on_owner_death(lane, core_.lanes[lane].dead_predecessor());
  return staging_.advance(lane, budget);
}

bool Intake::take_staged(std::uint32_t lane) noexcept {
  const StagedBatch next = staging_.front(lane);
  const Effort effort = core_.controller.effort(next.batch);
  if (!share_.affords(effort)) return false;
  share_.spend(effort);
  staging_.pop(lane);
  accept(next);
  return true;
}

/// Takes a batch, schedules it for its iteration, or rejects it.
void Intake::accept(const StagedBatch& sent) noexcept {
  commanders_.note_life(sent.lane);
  // A process may have halted and then sent this batch since the step has begun. The halt begins
  // before the batch, or its resume would find no halt in force and do nothing.
  halts_.begin_if_requested();
  if (!halts_.admitted_during_halt(sent)) return;
  const BatchRecord batch = core_.pool.batch(sent.batch);
  const bool bursts = batch.burst > 0 || (batch.flags & kBurstUntilEnded) != 0;
  const bool is_for_later = sent.at > core_.current;
  StagedBatch due = sent;
  if (due.at < 0) due.at = core_.current;
  // Control is checked when a batch is taken. The burst of a scheduled batch starts now, so it is
  // checked now as well.
  if (!is_for_later || bursts) {
    if (!admit(due)) return;
  } else if (commanders_.policy() == Stale::purge && commanders_.is_of_dead(due)) {
    core_.reject(due, Reason::dead_frontend);
    return;
  }
  if (is_for_later && !core_.schedule.has_room(due.lane, due.at)) {
    core_.reject(due, Reason::full);
    return;
  }
  if (bursts && !commanders_.is_of_dead(due)) bursts_.grant(due, batch);
  if (is_for_later) {
    core_.journal.scheduled(due, batch.id);
    core_.schedule.add(due);
  } else {
    take(due);
  }
}

/// True if a batch may be taken in this iteration; otherwise ends it.
bool Intake::admit(const StagedBatch& sent) noexcept {
  if (!halts_.admitted_during_halt(sent) || ends_for_silence(core_, sent)) return false;
  commanders_.watch_holder();
  const std::uint64_t sender = sent.sender_left ? 0 : sent.incarnation;
  const bool is_holders = commanders_.holder().is(sent.lane, sender);
  // control covers commands only: any commander may resume and mark
  const bool is_free = commanders_.holder().is_nobody() || core_.controller.effort(sent.batch).free;
  if (!is_free && !is_holders)
    return core_.reject(sent, Reason::exclusive, commanders_.holder().lane());
  if (sent.at < core_.current && !sent.late_now) return core_.reject(sent, Reason::late);
  if (commanders_.policy() == Stale::purge && commanders_.is_of_dead(sent))
    return core_.reject(sent, Reason::dead_frontend);
  return readings_.admitted_by_followers(sent);
}

void Intake::take(const StagedBatch& sent) noexcept {
  O80_COUNT(batch_taken);
  // if the ticket counter was reset since the batch was staged, a purge with the old ticket would
  // end batches that are sent from now on
  StagedBatch taken = sent;
  taken.ticket = core_.lanes.drawn_at_most(sent.ticket);
  core_.pool.batch(sent.batch).ticket = taken.ticket;
  take_decided(taken);
}

void Intake::take_decided(const StagedBatch& sent) noexcept {
  owner_ = sent.sender_left ? 0 : sent.incarnation;
  core_.deciding = &sent;
  if (core_.pool.batch(sent.batch).records > 0) core_.journal.acts();
  core_.controller.take(sent.lane, sent.batch, handler_);
  core_.deciding = nullptr;
}

void Intake::reject_all(Reason reason) noexcept {
  for (; !core_.schedule.empty(); core_.schedule.drop_next())
    core_.reject(core_.schedule.next(), reason);
  while (core_.schedule.has_aside()) core_.reject(core_.schedule.take_aside(), reason);
  for (std::uint32_t lane = 0; lane < core_.lanes.size(); ++lane) {
    for (; staging_.has_staged(lane); staging_.pop(lane))
      core_.reject(staging_.front(lane), reason);
  }
}

}  // namespace o80
