// Controller: takes a batch by executing the steps of its plan.

#include <limits>
#include <optional>

#include "control/controller.hpp"

namespace o80 {

void Controller::take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept {
  std::uint32_t budget = std::numeric_limits<std::uint32_t>::max();
  planner_.check(lane, batch, budget);
  const std::optional<Plan> plan = planner_.plan(batch);
  if (!plan) return ledger_.reject(lane, batch, Reason::invalid, 0, handler.iteration());

  const Iteration taken_at = handler.iteration();
  const Taking from{lane, pool_.batch(batch).ticket};
  ledger_.enter(lane, batch, plan->spare, plan->groups, taken_at);
  ledger_.reject_from(batch, plan->missing_from, Reason::invalid, 0, taken_at);
  for (BlockIndex step = plan->steps; step != kNoBlock;) {
    const BlockIndex record = step;
    step = pool_.head(record).own[Own::kNextStep];
    take_step(from, record, handler);
  }
  ledger_.close(batch, taken_at);
}

void Controller::take_step(const Taking& from, BlockIndex record, BatchHandler& handler) noexcept {
  const RecordHead& head = pool_.head(record);
  // read before the request: a fresh start in it increases the iteration
  const Iteration now = handler.iteration();
  const auto end = [&](const Outcome& outcome) {
    ledger_.end(record, outcome.status, outcome.reason, outcome.detail, now);
  };
  switch (head.kind) {
    case RecordKind::command:
    case RecordKind::overwriter_overwritten:
    case RecordKind::overwriter_purged:
      return take_commands(from, record, now);
    case RecordKind::purge:
      take_purge(from, head, now);
      return end({});
    case RecordKind::request: {
      const Cursor payload(pool_, record, sizeof(RecordHead), head.payload_bytes);
      const Outcome outcome = handler.request(from.lane, head.id, record, head.actuator, payload);
      if (outcome.status == Status::active) return ledger_.activate(record, now);
      return end(outcome);
    }
    case RecordKind::take_control:
      return end(handler.take_control(from.lane));
    case RecordKind::release_control:
      return end(handler.release_control(from.lane));
    case RecordKind::resume:
      return end(handler.resume(from.lane, head.id, static_cast<std::uint64_t>(head.amount),
                                head.accepts != 0));
    case RecordKind::overwritten_list:
      return ledger_.drop(record, Status::overwritten, Reason::none, now);
    case RecordKind::purged_list:
      return ledger_.drop(record, Status::purged, Reason::none, now);
    case RecordKind::completed_list:
      return ledger_.drop(record, Status::completed, Reason::none, now);
    default:
      ledger_.drop(record, Status::rejected, Reason::invalid, now);
  }
}

/// Appends a list of commands to the queue of its actuator, unless a purge or their own batch has
/// ended them.
void Controller::take_commands(const Taking& from, BlockIndex first, Iteration iteration) noexcept {
  const RecordHead& head = pool_.head(first);
  if (purge_tickets_.cover(from.lane, head.actuator, from.ticket)) {
    // purged commands must not overwrite commands that were sent after the purge
    return ledger_.drop(first, Status::purged, Reason::none, iteration);
  }
  ActuatorQueue& queue = actuators_[head.actuator];
  if (head.mode == Mode::overwrite) {
    O80_COUNT(queue_dropped);
    queue.drop(Status::overwritten, Reason::none, iteration);
  }
  if (head.kind != RecordKind::command) {
    const bool overwritten = head.kind == RecordKind::overwriter_overwritten;
    return ledger_.drop(first, overwritten ? Status::overwritten : Status::purged, Reason::none,
                        iteration);
  }
  queue.append(first, planner_.tail(first), from.lane);
  busy_[head.actuator / 64] |= std::uint64_t{1} << (head.actuator % 64);
}

void Controller::take_purge(const Taking& from, const RecordHead& head,
                            Iteration iteration) noexcept {
  const bool own = head.only_own != 0;
  if (own) {
    purge_tickets_.raise_own(from.lane, head.actuator, from.ticket);
  } else {
    purge_tickets_.raise(head.actuator, from.ticket);
  }
  each(head.actuator, [&](ActuatorQueue& queue) {
    if (own) {
      queue.drop_lane(from.lane, Status::purged, Reason::none, iteration);
    } else {
      queue.drop(Status::purged, Reason::none, iteration);
    }
  });
}

void Controller::reject(std::uint32_t lane, BlockIndex batch, Reason reason, std::uint8_t detail,
                        Iteration iteration, Status status) noexcept {
  planner_.forget(lane, batch);
  ledger_.reject(lane, batch, reason, detail, iteration, status);
}

}  // namespace o80
