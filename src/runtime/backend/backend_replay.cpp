// How a backend obeys the decisions of a recorded run instead of its lanes, its watchdog and its
// clock. See src/runtime/README.md#replay.

#include "runtime/backend/backend_body.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

/// Step of a replay: recorded decisions => desired.
Step UntypedBackend::Body::step_recorded() noexcept {
  const bool granted = obey_recorded();
  recorded->end_decisions(current);
  if (stop.load(std::memory_order_relaxed)) return Step::ended;
  // as before a burst: see step()
  while (granted && !controller.finish_pending()) {
  }
  move(Phase::iterating);
  return Step::run;
}

/// Obeys the decisions before the next step; true if a burst was granted among them. A fresh start
/// publishes a row, after which the decisions of the next iteration follow.
bool UntypedBackend::Body::obey_recorded() noexcept {
  bool granted = false;
  while (const JournalEntry* entry = recorded->next(current)) {
    if (entry->kind == JournalKind::interrupted && entry->iteration == current) {
      if (!entry->before_step || recorded->has_driver()) break;  // its reading follows the step
      interrupt(entry->actuator);
      continue;
    }
    if (entry->kind == JournalKind::burst) granted = true;
    const bool is_fresh = entry->kind == JournalKind::fresh_start && entry->iteration == current;
    if (is_fresh && !recorded->has_driver()) {
      start_afresh(entry->lane, 0);  // confirms the entry
    } else if (is_fresh && running.wanting_fresh_start() != nullptr) {
      start_afresh_after_request();
    } else {
      obey(recorded->take());
    }
    if (stop.load(std::memory_order_relaxed)) break;
  }
  return granted;
}

/// True if a request that ran has ended and the next step begins with a fresh start.
bool UntypedBackend::Body::will_start_afresh() const noexcept {
  if (running.wanting_fresh_start() != nullptr) return true;
  return recorded != nullptr && !recorded->has_driver() &&
         recorded->begins_with_fresh_start(current + 1);
}

void UntypedBackend::Body::obey(const JournalEntry& entry) noexcept {
  switch (entry.kind) {
    case JournalKind::taken:
    case JournalKind::rejected:
      return take_recorded(entry);
    case JournalKind::halt:
      recorded->compare_halt(entry);
      put_halt(segment.view(), entry.halt, entry.cause, entry.who, entry.text);
      return halts.watch();
    case JournalKind::died:
      controller.close_plan(entry.lane, ActuatorQueue::kEveryPlan);
      [[fallthrough]];
    case JournalKind::silent:
      if (commanders.policy() == Stale::purge) {
        const bool died = entry.kind == JournalKind::died;
        controller.purge_lane(entry.lane, kEveryActuator, current,
                              died ? Reason::dead_frontend : Reason::silence);
      }
      return;
    case JournalKind::order_lost:
      return controller.forget_tickets();
    case JournalKind::stopping:
      return purge_to_stop();
    case JournalKind::resume:
    case JournalKind::fresh_start:
    case JournalKind::interrupted:
      // confirmed when the driver repeats them
      return recorded->not_repeated(entry);
    default:
      return;
  }
}

/// Takes or rejects a recorded batch.
void UntypedBackend::Body::take_recorded(const JournalEntry& entry) noexcept {
  BlockChain chain;
  for (std::size_t at = 0; at < entry.blocks.size(); at += kBlockBytes) {
    if (pool.append(chain, entry.blocks.data() + at)) continue;
    return fail("the recorded batches need more blocks than the lanes of this replay have");
  }
  if (chain.blocks == 0) return;
  const StagedBatch sent{.at = entry.at,
                         .ticket = entry.ticket,
                         .batch = chain.first,
                         .lane = entry.lane,
                         .incarnation = entry.owner,
                         .sender_left = entry.owner == 0};
  pool.batch(chain.first).ticket = entry.ticket;
  if (entry.kind == JournalKind::taken) {
    intake.take_decided(sent);
  } else {
    end_batch(sent, entry.reason, entry.detail, Status::rejected);
  }
}

}  // namespace o80
