#include "control/queue/controller.hpp"

#include <bit>
#include <limits>

namespace o80 {
namespace {

/// Calls `visit(index)` for each bit set.
template <class Visit>
void each_bit(std::uint64_t word, std::uint32_t base, Visit&& visit) noexcept {
  for (; word != 0; word &= word - 1) {
    visit(base + static_cast<std::uint32_t>(std::countr_zero(word)));
  }
}

}  // namespace

Controller::Controller(const Schema& schema, BlockPool& pool, StatusSink& sink, std::uint32_t lanes)
    : pool_(pool),
      sink_(sink),
      ledger_(pool, sink),
      layouts_(layouts_of_types(schema)),
      planner_(schema, layouts_, pool, lanes),
      purge_tickets_(lanes, static_cast<std::uint32_t>(schema.actuators.size())),
      desired_((schema.head.block + kBlockBytes - 1) / kBlockBytes) {
  const auto count = static_cast<std::uint32_t>(schema.actuators.size());
  const std::uint32_t words = mask_words(count);
  for (Mask* mask : {&active_mask_, &clamped_mask_, &braking_mask_, &starved_mask_, &busy_,
                     &stepped_, &follow_, &interrupted_, &dropped_, &of_chunk_}) {
    mask->resize(words);
  }
  actuators_.reserve(count);
  waiting_.reserve(kMaxWaiting);
  auto* block = reinterpret_cast<std::byte*>(desired_.data());
  std::size_t numbers = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const ActuatorRow& row = schema.actuators[i];
    numbers += layouts_[row.type]->numbers().size();
    offsets_.push_back(row.offset);
    actuators_.emplace_back(schema, row, *layouts_[row.type], pool_, ledger_, block + row.offset,
                            lanes);
    set(busy_, i);
    if (row.when_idle == WhenIdle::follow) set(follow_, i);
  }
  starts_.resize(numbers);
  off_plan_.resize((count + 1) / 2 * 2);  // whole words, as in a row
}

/// Begins the commands of several actuators whose members are next in all queues.
void Controller::step_groups(Iteration iteration, const std::byte* observed,
                             std::uint32_t& late_budget) noexcept {
  // end dropped members first, so that the others of their group do not wait for them
  reported_ = ledger_.report_ends(kStatusesPerIteration);
  if (ledger_.undecided_groups() == 0) return;
  const auto each_busy = [&](auto&& visit) {
    for (std::size_t word = 0; word < busy_.size(); ++word) {
      each_bit(busy_[word], static_cast<std::uint32_t>(word * 64), visit);
    }
  };
  each_busy([&](std::uint32_t i) { actuators_[i].arrive(iteration, late_budget); });
  each_busy([&](std::uint32_t i) {
    if (!actuators_[i].follows()) return;
    const BlockIndex group = actuators_[i].beginning_group(iteration);
    if (group == kNoBlock) return;
    if (sink_.may_begin(i, ledger_.lane_of(group), pool_.head(group).id)) return;
    actuators_[i].drop({Status::interrupted, Reason::reading}, iteration);
  });
  each_busy([&](std::uint32_t i) { actuators_[i].agree_on_carry(iteration); });
  each_busy([&](std::uint32_t i) { actuators_[i].plan_with_others(iteration, of(i, observed)); });
}

void Controller::step(Iteration iteration, const std::byte* observed) noexcept {
  std::uint32_t late_budget = kStatusesPerIteration;
  reported_ = 0;
  while (!waiting_.empty() && waiting_.front().begins <= iteration) {
    const Waiting begun = waiting_.front();
    waiting_.erase(waiting_.begin());
    begin_chunk(begun.group, begun.lane, iteration);
  }
  for (std::uint32_t word = 0; all_follow_ && word < interrupted_.size(); ++word) {
    each_bit(std::exchange(interrupted_[word], 0), word * 64,
             [&](std::uint32_t i) { actuators_[i].begin_at(of(i, observed)); });
  }
  if (ledger_.open_groups() > 0) step_groups(iteration, observed, late_budget);
  const bool gives = given_.acts(iteration);
  if (gives) step_given(iteration, observed);
  bool knows_waiting = false;
  bool starves = false;
  for (std::size_t word = 0; word < busy_.size(); ++word) {
    const auto base = static_cast<std::uint32_t>(word * 64);
    const std::uint64_t stepped = gives ? stepped_[word] : 0;
    std::uint64_t active = stepped;
    std::uint64_t clamped = gives ? clamped_mask_[word] & stepped : 0;
    std::uint64_t braking = 0;
    const std::uint64_t busy = busy_[word];
    std::uint64_t starved = 0;

    // idle actuators follow the observed state, busy ones step
    each_bit(follow_[word] & ~busy, base,
             [&](std::uint32_t i) { actuators_[i].follow(of(i, observed)); });
    each_bit(busy & ~stepped, base, [&](std::uint32_t i) {
      using Moved = ActuatorQueue::Moved;
      ActuatorQueue& queue = actuators_[i];
      const std::uint64_t bit = std::uint64_t{1} << (i % 64);
      const Moved moved = queue.step(iteration, of(i, observed), late_budget);
      // the queue is not empty if late commands have used up their budget
      if (moved == Moved::idle && queue.empty() && queue.at_rest()) busy_[word] &= ~bit;
      const bool has_no_command = moved == Moved::idle || moved == Moved::braking;
      if (has_no_command && queue.starved() && !awaits_chunk(i, knows_waiting)) starved |= bit;
      off_plan_[i] = moved == Moved::clamped ? queue.off_plan() : 0.0F;
      if (moved == Moved::idle) return;
      queue.acted(iteration);
      active |= bit;
      if (moved == Moved::braking) braking |= bit;
      if (moved == Moved::clamped) clamped |= bit;
    });
    active_mask_[word] = active;
    clamped_mask_[word] = clamped;
    braking_mask_[word] = braking;
    if (busy == 0) continue;
    if ((starved & ~starved_mask_[word]) != 0 && !std::exchange(starves, true)) ++starvations_;
    starved_mask_[word] = (starved_mask_[word] & ~busy) | starved;
  }
  reported_ += kStatusesPerIteration - late_budget;
}

/// The targets of this iteration => desired.
void Controller::step_given(Iteration iteration, const std::byte* observed) noexcept {
  const bool first = !std::exchange(was_given_, true);
  if (first) std::ranges::fill(dropped_, 0);
  std::ranges::fill(stepped_, 0);
  const auto step = static_cast<std::size_t>(iteration - given_.first);
  const std::byte* states = given_.states;
  for (const std::uint32_t i : given_.actuators) {
    const std::size_t size = actuators_[i].layout().size();
    const std::byte* target = states + step * size;
    states += given_.steps * size;
    if (masked(dropped_.data(), i)) continue;
    if (first) actuators_[i].begin_given(given_.mode);
    clamped_mask_[i / 64] &= ~(std::uint64_t{1} << (i % 64));
    off_plan_[i] = 0.0F;
    if (actuators_[i].go_to(iteration, of(i, observed), target) == ActuatorQueue::Moved::clamped) {
      set(clamped_mask_, i);
      off_plan_[i] = actuators_[i].off_plan();
    }
    actuators_[i].acted(iteration);
    set(stepped_, i);
    set(busy_, i);
  }
}

void Controller::take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept {
  std::uint32_t budget = std::numeric_limits<std::uint32_t>::max();
  planner_.check(lane, batch, budget);
  const std::optional<Plan> plan = planner_.plan(batch);
  const Iteration taken_at = handler.iteration();
  if (!plan) return ledger_.reject(lane, batch, {Status::rejected, Reason::invalid}, taken_at);

  const Taking from{lane, pool_.batch(batch).ticket};
  const BlockChain spare{plan->spare_first, pool_.chain(batch).last, plan->spare_blocks};
  ledger_.enter(lane, batch, spare, plan->missing_from, plan->effort.groups, taken_at);
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
  const auto end = [&](const Outcome& outcome) { ledger_.end(record, outcome, now); };
  switch (head.kind) {
    case RecordKind::command:
    case RecordKind::overwriter_overwritten:
    case RecordKind::overwriter_purged:
      return take_commands(from, record, now);
    case RecordKind::group:
      return take_chunk(from, record, handler);
    case RecordKind::purge: {
      const bool own = head.only_own != 0;
      purge_tickets_.raise(own ? from.lane : PurgeTickets::kEveryLane, head.actuator, from.ticket);
      if (own) {
        purge_lane(from.lane, head.actuator, now);
      } else {
        purge(head.actuator, now);
      }
      return end({});
    }
    case RecordKind::request: {
      const Cursor payload(pool_, record, sizeof(RecordHead), head.payload_bytes);
      const Outcome outcome = handler.request(from.lane, head.id, record, head.actuator, payload);
      if (outcome.status == Status::active) return ledger_.activate(record, now);
      return end(outcome);
    }
    case RecordKind::close_plan:
      close_plan(from.lane, static_cast<std::uint64_t>(head.amount));
      return end({});
    case RecordKind::take_control:
      return end(handler.take_control(from.lane));
    case RecordKind::release_control:
      return end(handler.release_control(from.lane));
    case RecordKind::resume:
      return end(handler.resume(from.lane, head.id, static_cast<std::uint64_t>(head.amount),
                                head.accepts != 0));
    case RecordKind::overwritten_list:
      return ledger_.drop(record, {Status::overwritten}, now);
    case RecordKind::purged_list:
      return ledger_.drop(record, {Status::purged}, now);
    case RecordKind::completed_list:
      return ledger_.drop(record, {Status::completed}, now);
    default:
      ledger_.drop(record, {Status::rejected, Reason::invalid}, now);
  }
}

/// Appends a list of commands to its queue, unless a purge or their own batch has ended them.
void Controller::take_commands(const Taking& from, BlockIndex first, Iteration iteration) noexcept {
  const RecordHead& head = pool_.head(first);
  if (purge_tickets_.cover(from.lane, head.actuator, from.ticket)) {
    // purged commands must not overwrite commands that were sent after the purge
    return ledger_.drop(first, {Status::purged}, iteration);
  }
  ActuatorQueue& queue = actuators_[head.actuator];
  if (head.mode == Mode::overwrite) {
    O80_COUNT(queue_dropped);
    drop_waiting(kEveryLane, head.actuator, {Status::overwritten}, iteration);
    queue.drop({Status::overwritten}, iteration);
  }
  if (head.kind != RecordKind::command) {
    const bool overwritten = head.kind == RecordKind::overwriter_overwritten;
    return ledger_.drop(first, {overwritten ? Status::overwritten : Status::purged}, iteration);
  }
  queue.append(first, planner_.tail(first), from.lane);
  set(busy_, head.actuator);
}

// ------------------------------------------------------------------------------ chunks

/// Decides on a chunk: it waits, begins, or is rejected.
void Controller::take_chunk(const Taking& from, BlockIndex group, BatchHandler& handler) noexcept {
  const Iteration now = handler.iteration();
  const auto is_purged = [&](std::uint32_t actuator) {
    return purge_tickets_.cover(from.lane, actuator, from.ticket);
  };
  if (!drop_members(group, is_purged, {Status::purged}, now)) return;
  std::ranges::fill(of_chunk_, 0);
  each_member(group, [&](BlockIndex member) { set(of_chunk_, pool_.head(member).actuator); });
  const std::uint64_t epoch = handler.epoch();
  const bool is_foreign = epoch != 0 && chunk_of(pool_, group).epoch != epoch;
  const Reason reason = is_foreign ? Reason::invalid : decide(from, group, now);
  if (reason != Reason::none) {
    const Outcome rejected{Status::rejected, reason};
    return each_member(group, [&](BlockIndex member) { ledger_.end(member, rejected, now); });
  }
  const ChunkHead& chunk = chunk_of(pool_, group);
  ledger_.note_decided(group, {chunk.shift, chunk.stood != 0}, now);
  each_member(group, [&](BlockIndex member) {
    const std::uint32_t actuator = pool_.head(member).actuator;
    actuators_[actuator].last_chunk = {from.lane, chunk.plan, chunk.anchor};
  });
  drop_waiting(
      kEveryLane, [&](std::uint32_t i) { return masked(of_chunk_.data(), i); },
      {Status::overwritten}, now, chunk.begins);
  const Waiting waiting{group, from.lane, chunk.begins};
  if (waiting.begins == now) return begin_chunk(group, from.lane, now);
  recheck_starved();
  waiting_.insert(std::ranges::upper_bound(waiting_, waiting.begins, {}, &Waiting::begins),
                  waiting);
}

/// Reason::none if the chunk of the actuators in of_chunk_ is taken.
Reason Controller::decide(const Taking& from, BlockIndex group, Iteration now) noexcept {
  ChunkHead& chunk = chunk_of(pool_, group);
  ChunkSurroundings at{.now = now, .stand = true};
  bool is_older = false;
  each_member(group, [&](BlockIndex member) {
    const ActuatorQueue& queue = actuators_[pool_.head(member).actuator];
    const ActuatorQueue::LastChunk& last = queue.last_chunk;
    is_older = is_older ||
               (last.lane == from.lane && last.plan == chunk.plan && chunk.anchor < last.anchor);
    at.stand = at.stand && queue.empty();
    at.acted_last = std::max(at.acted_last, queue.acted_last());
  });
  for (const Waiting& each : waiting_) {
    each_member(each.group, [&](BlockIndex member) {
      at.stand = at.stand && !masked(of_chunk_.data(), pool_.head(member).actuator);
    });
  }
  if (is_older) return Reason::older;
  if (chunk.anchor < fresh_row_) return Reason::fresh_start;
  const BlockIndex first = pool_.head(group).own[Own::kNext];
  const ActuatorQueue& queue = actuators_[pool_.head(first).actuator];
  const Reason reason = judge(chunk, ChunkRows(pool_, first, queue.layout()), at);
  const bool is_full = waiting_.size() == kMaxWaiting && chunk.begins > now;
  return reason == Reason::none && is_full ? Reason::full : reason;
}

/// The row to which a chunk that begins takes over.
BegunChunk Controller::take_over(BlockIndex group, Iteration iteration) noexcept {
  const ChunkHead& chunk = chunk_of(pool_, group);
  const BlockIndex first = pool_.head(group).own[Own::kNext];
  const RecordHead& head = pool_.head(first);
  const ChunkRows rows(pool_, first, actuators_[head.actuator].layout());
  const bool holds = head.profile == Profile::hold;
  return first_row(rows, iteration - chunk.anchor - chunk.shift, holds ? 1 : chunk.ease,
                   [&](std::uint32_t row, std::int64_t iterations) {
                     double most = 0.0;
                     each_member(group, [&](BlockIndex member) {
                       ActuatorQueue& queue = actuators_[pool_.head(member).actuator];
                       if (holds) return;
                       most = std::max(most, queue.to_take_over(member, row, iterations));
                     });
                     return most;
                   });
}

void Controller::begin_chunk(BlockIndex group, std::uint32_t lane, Iteration iteration) noexcept {
  const BegunChunk begun = take_over(group, iteration);
  chunk_of(pool_, group).row = begun.row;
  std::size_t starts = 0;
  each_member(group, [&](BlockIndex member) {
    ActuatorQueue& queue = actuators_[pool_.head(member).actuator];
    starts += queue.put_starts(member, std::span(starts_).subspan(starts));
  });
  sink_.begun({lane, pool_.head(group).id, begun.row, chunk_of(pool_, group).shift,
               std::span(starts_).first(starts)});
  ledger_.note_begun(group, begun, iteration);
  each_member(group, [&](BlockIndex member) {
    pool_.head(member).own[Own::kNext] = kNoBlock;
    const std::uint32_t actuator = pool_.head(member).actuator;
    O80_COUNT(queue_dropped);
    actuators_[actuator].drop({Status::overwritten}, iteration);
    actuators_[actuator].append(member, member, lane);
    actuators_[actuator].open_plan(lane, chunk_of(pool_, group));
    set(busy_, actuator);
  });
}

void Controller::close_plan(std::uint32_t lane, std::uint64_t plan) noexcept {
  for (const Waiting& each : waiting_) {
    ChunkHead& chunk = chunk_of(pool_, each.group);
    const bool is_meant = plan == ActuatorQueue::kEveryPlan || chunk.plan == plan;
    if (each.lane == lane && is_meant) chunk.final = 1;
  }
  for (ActuatorQueue& queue : actuators_) queue.close_plan(lane, plan);
  recheck_starved();
}

/// True if a chunk of this actuator waits for its begin. `known`: of_chunk_ has the actuators of
/// all that wait.
bool Controller::awaits_chunk(std::uint32_t actuator, bool& known) noexcept {
  if (waiting_.empty()) return false;
  if (!std::exchange(known, true)) {
    std::ranges::fill(of_chunk_, 0);
    for (const Waiting& each : waiting_) {
      each_member(each.group,
                  [&](BlockIndex member) { set(of_chunk_, pool_.head(member).actuator); });
    }
  }
  return masked(of_chunk_.data(), actuator);
}

template <class Ends>
bool Controller::drop_members(BlockIndex group, Ends&& ends, const Outcome& outcome,
                              Iteration iteration) noexcept {
  // the group is freed with its last member
  BlockIndex kept = kNoBlock;
  BlockIndex dropped = kNoBlock;
  each_member(group, [&](BlockIndex member) {
    RecordHead& head = pool_.head(member);
    head.own[Own::kNext] = std::exchange(ends(head.actuator) ? dropped : kept, member);
  });
  pool_.head(group).own[Own::kNext] = kept;
  ledger_.drop(dropped, outcome, iteration);
  return kept != kNoBlock;
}

template <class Ends>
void Controller::drop_waiting(std::uint32_t lane, Ends&& ends, const Outcome& outcome,
                              Iteration iteration, Iteration from) noexcept {
  std::erase_if(waiting_, [&](const Waiting& each) {
    if ((lane != kEveryLane && each.lane != lane) || each.begins < from) return false;
    return !drop_members(each.group, ends, outcome, iteration);
  });
}

void Controller::drop_waiting(std::uint32_t lane, std::uint32_t actuator, const Outcome& outcome,
                              Iteration iteration) noexcept {
  const auto is_meant = [&](std::uint32_t i) {
    return actuator == kEveryActuator || i == actuator;
  };
  drop_waiting(lane, is_meant, outcome, iteration, 0);
}

}  // namespace o80
