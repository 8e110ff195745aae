#include "control/controller.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "control/actuator_queue.hpp"
#include "control/batch_plan.hpp"
#include "control/ledger.hpp"
#include "control/purge_tickets.hpp"
#include "control/state_layout.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

/// What blends its states in its own way has no numbers that could be limited one by one.
void refuse_limits(const Schema& schema, const ActuatorRow& actuator) {
  for (std::uint32_t i = 0; i < actuator.limits; ++i) {
    const LimitRow& limit = schema.limits.at(actuator.first_limit + i);
    if (std::isfinite(limit.minimum) || std::isfinite(limit.maximum) ||
        std::isfinite(limit.speed) || limit.resting != 0) {
      throw InvalidArgument("actuator '" + actuator.name.str() + "' has limits, but its type '" +
                            schema.types[actuator.type].name.str() +
                            "' brings its own blend(): limit it in the driver");
    }
  }
}

std::vector<std::optional<StateLayout>> layouts_of(const Schema& schema) {
  std::vector<std::optional<StateLayout>> layouts(schema.types.size());
  for (const ActuatorRow& actuator : schema.actuators) {
    auto& layout = layouts.at(actuator.type);
    if (!layout) layout.emplace(schema, actuator.type);
    if (layout->numbers().empty()) {
      throw InvalidArgument("actuator '" + actuator.name.str() +
                            "' has a state without numbers: describe at least one field of '" +
                            schema.types[actuator.type].name.str() + "'");
    }
    if (layout->hooks().blend != nullptr) refuse_limits(schema, actuator);
    if (actuator.offset + layout->size() > schema.head.block) {
      throw InvalidArgument("actuator '" + actuator.name.str() +
                            "' lies outside the robot's block of " +
                            std::to_string(schema.head.block) + " bytes");
    }
  }
  for (const RequestRow& request : schema.requests) {
    if (request.type == kNoType) continue;
    auto& layout = layouts.at(request.type);
    if (!layout) layout.emplace(schema, request.type);
  }
  return layouts;
}

RecordCheck::Layouts pointers_to(const std::vector<std::optional<StateLayout>>& layouts) {
  RecordCheck::Layouts pointers;
  for (const auto& layout : layouts) pointers.push_back(layout ? &*layout : nullptr);
  return pointers;
}

/// Calls `visit(index)` for each bit set.
template <class Visit>
void each_bit(std::uint64_t word, std::uint32_t base, Visit&& visit) noexcept {
  for (; word != 0; word &= word - 1) {
    visit(base + static_cast<std::uint32_t>(std::countr_zero(word)));
  }
}

}  // namespace

class Controller::Body {
 public:
  Body(const Schema& schema, BlockPool& pool, StatusSink& sink, std::uint32_t lanes);

  void restart(const std::byte* observed, const std::byte* desired, Iteration row) noexcept;
  void take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept;
  void step(Iteration iteration, const std::byte* observed) noexcept;
  void step_groups(Iteration iteration, const std::byte* observed,
                   std::uint32_t& late_budget) noexcept;
  bool finish_pending() noexcept;
  bool active() const noexcept;
  bool acts(std::uint32_t lane) const noexcept;
  /// In the last step, or, if it has just lost its command, in the next one.
  bool braking() const noexcept {
    return std::ranges::any_of(braking_mask, [](std::uint64_t word) { return word != 0; }) ||
           std::ranges::any_of(actuators_, [](const ActuatorQueue& queue) {
             return queue.empty() && !queue.at_rest();
           });
  }
  bool holds() const noexcept {
    return std::ranges::any_of(actuators_,
                               [](const ActuatorQueue& queue) { return queue.holds(); });
  }
  std::optional<NotFinite> not_finite(const std::byte* block) const noexcept;

  /// Calls `visit(ActuatorQueue&)` for one actuator or every one, which may have to come to rest.
  template <class Visit>
  void each(std::uint32_t actuator, Visit&& visit) noexcept {
    const auto last = static_cast<std::uint32_t>(actuators_.size());
    for (std::uint32_t i = actuator == kEveryActuator ? 0 : actuator; i < last; ++i) {
      O80_COUNT(queue_dropped);
      visit(actuators_[i]);
      busy_[i / 64] |= std::uint64_t{1} << (i % 64);
      if (actuator != kEveryActuator) return;
    }
  }

  BlockPool& pool;
  Ledger ledger;

 private:
  /// The batch that is being taken.
  struct Taking {
    std::uint32_t lane;
    std::uint64_t ticket;
  };
  void take_step(const Taking& from, BlockIndex record, BatchHandler& handler) noexcept;
  void take_commands(const Taking& from, BlockIndex first, Iteration iteration) noexcept;
  void purge(const Taking& from, const RecordHead& head, Iteration iteration) noexcept;
  const std::byte* of(std::uint32_t actuator, const std::byte* block) const noexcept {
    return block + offsets_[actuator];
  }

  std::vector<std::optional<StateLayout>> layouts_;

 public:
  BatchPlanner planner;
  PurgeTickets purge_tickets;
  std::vector<Block> desired;
  std::vector<std::uint64_t> active_mask;
  std::vector<std::uint64_t> clamped_mask;
  std::vector<std::uint64_t> braking_mask;

 private:
  std::vector<std::uint32_t> offsets_;
  std::vector<const StateLayout*> types_;  // of each actuator
  std::vector<ActuatorQueue> actuators_;
  std::vector<std::uint64_t> busy_;    // has commands, or has just lost its last
  std::vector<std::uint64_t> follow_;  // follows when idle
  std::uint32_t told_ = 0;             // statuses, in the last step
};

Controller::Body::Body(const Schema& schema, BlockPool& blocks, StatusSink& sink,
                       std::uint32_t lanes)
    : pool(blocks),
      ledger(blocks, sink),
      layouts_(layouts_of(schema)),
      planner(schema, pointers_to(layouts_), blocks, lanes),
      purge_tickets(lanes, static_cast<std::uint32_t>(schema.actuators.size())),
      desired((schema.head.block + kBlockBytes - 1) / kBlockBytes) {
  const auto count = static_cast<std::uint32_t>(schema.actuators.size());
  const std::uint32_t words = mask_words(count);
  active_mask.resize(words);
  clamped_mask.resize(words);
  braking_mask.resize(words);
  busy_.resize(words);
  follow_.resize(words);
  actuators_.reserve(count);
  auto* block = reinterpret_cast<std::byte*>(desired.data());
  for (std::uint32_t i = 0; i < count; ++i) {
    const ActuatorRow& row = schema.actuators[i];
    offsets_.push_back(row.offset);
    types_.push_back(&*layouts_[row.type]);
    actuators_.emplace_back(schema, row, *layouts_[row.type], pool, ledger, block + row.offset,
                            lanes);
    busy_[i / 64] |= std::uint64_t{1} << (i % 64);
    if (row.when_idle == WhenIdle::follow) follow_[i / 64] |= std::uint64_t{1} << (i % 64);
  }
}

void Controller::Body::restart(const std::byte* observed, const std::byte* wanted,
                               Iteration row) noexcept {
  const std::byte* source = wanted != nullptr ? wanted : observed;
  for (std::uint32_t i = 0; i < actuators_.size(); ++i) {
    O80_COUNT(queue_dropped);
    actuators_[i].drop(Status::purged, Reason::fresh_start, row);
    actuators_[i].restart(of(i, source));
    busy_[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  for (std::size_t word = 0; word < busy_.size(); ++word) {
    active_mask[word] = 0;
    clamped_mask[word] = 0;
    braking_mask[word] = 0;
  }
}

void Controller::Body::take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept {
  std::uint32_t budget = std::numeric_limits<std::uint32_t>::max();
  planner.check(lane, batch, budget);
  const std::optional<Plan> plan = planner.plan(batch);
  if (!plan) return ledger.reject(lane, batch, Reason::invalid, 0, handler.iteration());

  const Iteration taken_at = handler.iteration();
  const Taking from{lane, pool.batch(batch).ticket};
  ledger.enter(lane, batch, plan->spare, plan->groups, taken_at);
  ledger.reject_from(batch, plan->missing_from, Reason::invalid, 0, taken_at);
  for (BlockIndex step = plan->steps; step != kNoBlock;) {
    const BlockIndex record = step;
    step = pool.head(record).own[Own::kOther];
    take_step(from, record, handler);
  }
  ledger.close(batch, taken_at);
}

void Controller::Body::take_step(const Taking& from, BlockIndex record,
                                 BatchHandler& handler) noexcept {
  const RecordHead& head = pool.head(record);
  // a fresh start moves the count on: the request bears the iteration of the fresh row
  const Iteration now = handler.iteration();
  const auto end = [&](const Outcome& outcome) {
    ledger.end(record, outcome.status, outcome.reason, outcome.aux, now);
  };
  switch (head.kind) {
    case RecordKind::command:
    case RecordKind::overwriter_overwritten:
    case RecordKind::overwriter_purged:
      return take_commands(from, record, now);
    case RecordKind::purge:
      purge(from, head, now);
      return end({});
    case RecordKind::request: {
      const Cursor payload(pool, record, sizeof(RecordHead), head.payload_bytes);
      const Outcome outcome = handler.request(from.lane, head.id, record, head.actuator, payload);
      if (outcome.status == Status::active) return ledger.activate(record, now);
      return end(outcome);
    }
    case RecordKind::take_control:
      return end(handler.take_control(from.lane));
    case RecordKind::release_control:
      return end(handler.release_control(from.lane));
    case RecordKind::resume:
      return end(handler.resume(from.lane, head.id, static_cast<std::uint64_t>(head.amount)));
    case RecordKind::overwritten_list:
      return ledger.drop(record, Status::overwritten, Reason::none, now);
    case RecordKind::purged_list:
      return ledger.drop(record, Status::purged, Reason::none, now);
    case RecordKind::completed_list:
      return ledger.drop(record, Status::completed, Reason::none, now);
    default:
      ledger.drop(record, Status::rejected, Reason::invalid, now);
  }
}

/// Appends a list of commands, unless something has ended them before they came to be taken.
void Controller::Body::take_commands(const Taking& from, BlockIndex first,
                                     Iteration iteration) noexcept {
  const RecordHead& head = pool.head(first);
  if (purge_tickets.cover(from.lane, head.actuator, from.ticket)) {
    // what was sent after that purge is not theirs to overwrite
    return ledger.drop(first, Status::purged, Reason::none, iteration);
  }
  ActuatorQueue& queue = actuators_[head.actuator];
  if (head.mode == Mode::overwrite) {
    O80_COUNT(queue_dropped);
    queue.drop(Status::overwritten, Reason::none, iteration);
  }
  if (head.kind != RecordKind::command) {
    const bool overwritten = head.kind == RecordKind::overwriter_overwritten;
    return ledger.drop(first, overwritten ? Status::overwritten : Status::purged, Reason::none,
                       iteration);
  }
  queue.append(first, planner.tail(first), from.lane);
  busy_[head.actuator / 64] |= std::uint64_t{1} << (head.actuator % 64);
}

void Controller::Body::purge(const Taking& from, const RecordHead& head,
                             Iteration iteration) noexcept {
  const bool own = head.partial != 0;
  if (own) {
    purge_tickets.raise_own(from.lane, head.actuator, from.ticket);
  } else {
    purge_tickets.raise(head.actuator, from.ticket);
  }
  each(head.actuator, [&](ActuatorQueue& queue) {
    if (own) {
      queue.drop_lane(from.lane, Status::purged, Reason::none, iteration);
    } else {
      queue.drop(Status::purged, Reason::none, iteration);
    }
  });
}

/// Commands of several actuators begin when all their queues have come to them.
void Controller::Body::step_groups(Iteration iteration, const std::byte* observed,
                                   std::uint32_t& late_budget) noexcept {
  // dropped members end before those that step; the others do not wait for them
  told_ = ledger.work(kStatusesPerIteration);
  if (ledger.undecided_groups() == 0) return;
  const auto each_busy = [&](auto&& visit) {
    for (std::size_t word = 0; word < busy_.size(); ++word) {
      each_bit(busy_[word], static_cast<std::uint32_t>(word * 64), visit);
    }
  };
  each_busy([&](std::uint32_t i) { actuators_[i].arrive(iteration, late_budget); });
  each_busy([&](std::uint32_t i) { actuators_[i].plan_with_others(iteration, of(i, observed)); });
}

void Controller::Body::step(Iteration iteration, const std::byte* observed) noexcept {
  std::uint32_t late_budget = kStatusesPerIteration;
  told_ = 0;
  if (ledger.open_groups() > 0) step_groups(iteration, observed, late_budget);
  for (std::size_t word = 0; word < busy_.size(); ++word) {
    const auto base = static_cast<std::uint32_t>(word * 64);
    std::uint64_t active = 0;
    std::uint64_t clamped = 0;
    std::uint64_t braking = 0;

    // who had nothing to do before follows on, the others move
    each_bit(follow_[word] & ~busy_[word], base,
             [&](std::uint32_t i) { actuators_[i].follow(of(i, observed)); });
    each_bit(busy_[word], base, [&](std::uint32_t i) {
      ActuatorQueue& queue = actuators_[i];
      const std::uint64_t bit = std::uint64_t{1} << (i % 64);
      switch (queue.step(iteration, of(i, observed), late_budget)) {
        case ActuatorQueue::Moved::idle:
          // late commands in a row may have used up the iteration's share of work
          if (queue.empty()) busy_[word] &= ~bit;
          break;
        case ActuatorQueue::Moved::braking:
          braking |= bit;
          active |= bit;
          break;
        case ActuatorQueue::Moved::clamped:
          clamped |= bit;
          [[fallthrough]];
        case ActuatorQueue::Moved::active:
          active |= bit;
      }
    });
    active_mask[word] = active;
    clamped_mask[word] = clamped;
    braking_mask[word] = braking;
  }
  told_ += kStatusesPerIteration - late_budget;
}

bool Controller::Body::finish_pending() noexcept {
  const std::uint32_t told = std::min(std::exchange(told_, 0), kStatusesPerIteration);
  ledger.work(kStatusesPerIteration - told);
  return !ledger.pending();
}

bool Controller::Body::acts(std::uint32_t lane) const noexcept {
  return std::ranges::any_of(actuators_,
                             [&](const ActuatorQueue& queue) { return queue.acts(lane); });
}

std::optional<NotFinite> Controller::Body::not_finite(const std::byte* block) const noexcept {
  for (std::uint32_t i = 0; i < actuators_.size(); ++i) {
    const std::uint32_t number = types_[i]->first_not_finite(of(i, block));
    if (number != StateLayout::kNoNumber) return NotFinite{i, number};
  }
  return std::nullopt;
}

bool Controller::Body::active() const noexcept {
  for (const ActuatorQueue& queue : actuators_) {
    if (!queue.empty()) return true;
  }
  return false;
}

Controller::Controller(const Schema& schema, BlockPool& pool, StatusSink& sink, std::uint32_t lanes)
    : body_(std::make_unique<Body>(schema, pool, sink, lanes)) {}

Controller::~Controller() = default;

void Controller::restart(const std::byte* observed, const std::byte* desired,
                         Iteration row) noexcept {
  body_->restart(observed, desired, row);
}

bool Controller::check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept {
  return body_->planner.check(lane, batch, budget);
}

Effort Controller::effort(BlockIndex batch) const noexcept { return body_->planner.effort(batch); }

void Controller::take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept {
  body_->take(lane, batch, handler);
}

void Controller::reject(std::uint32_t lane, BlockIndex batch, Reason reason, std::uint8_t aux,
                        Iteration iteration, Status status) noexcept {
  body_->planner.forget(lane, batch);
  body_->ledger.reject(lane, batch, reason, aux, iteration, status);
}

void Controller::end(BlockIndex request, const Outcome& outcome, Iteration iteration) noexcept {
  body_->ledger.end(request, outcome.status, outcome.reason, outcome.aux, iteration);
}

void Controller::step(Iteration iteration, const std::byte* observed) noexcept {
  body_->step(iteration, observed);
}

void Controller::purge(std::uint32_t actuator, Iteration iteration, Reason reason) noexcept {
  body_->each(actuator,
              [&](ActuatorQueue& queue) { queue.drop(Status::purged, reason, iteration); });
}

void Controller::purge_lane(std::uint32_t lane, std::uint32_t actuator, Iteration iteration,
                            Reason reason) noexcept {
  body_->each(actuator, [&](ActuatorQueue& queue) {
    queue.drop_lane(lane, Status::purged, reason, iteration);
  });
}

void Controller::forget_tickets() noexcept { body_->purge_tickets.forget(); }

void Controller::halt(Iteration iteration) noexcept {
  body_->each(kEveryActuator,
              [&](ActuatorQueue& queue) { queue.drop(Status::halted, Reason::halted, iteration); });
}

void Controller::interrupt(std::uint32_t actuator, Iteration iteration) noexcept {
  body_->each(actuator, [&](ActuatorQueue& queue) {
    queue.drop(Status::interrupted, Reason::none, iteration);
  });
}

bool Controller::finish_pending() noexcept { return body_->finish_pending(); }

const std::byte* Controller::desired() const noexcept {
  return reinterpret_cast<const std::byte*>(body_->desired.data());
}

const std::uint64_t* Controller::active_mask() const noexcept { return body_->active_mask.data(); }

const std::uint64_t* Controller::clamped_mask() const noexcept {
  return body_->clamped_mask.data();
}

const std::uint64_t* Controller::braking_mask() const noexcept {
  return body_->braking_mask.data();
}

bool Controller::braking() const noexcept { return body_->braking(); }

std::uint32_t Controller::words() const noexcept {
  return static_cast<std::uint32_t>(body_->active_mask.size());
}

bool Controller::holds() const noexcept { return body_->holds(); }
bool Controller::acts(std::uint32_t lane) const noexcept { return body_->acts(lane); }

std::optional<NotFinite> Controller::not_finite(const std::byte* block) const noexcept {
  return body_->not_finite(block);
}

bool Controller::active() const noexcept { return body_->active(); }
bool Controller::pending() const noexcept { return body_->ledger.pending(); }

}  // namespace o80
