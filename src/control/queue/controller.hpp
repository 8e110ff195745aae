#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "control/batch/record.hpp"
#include "control/motion/state_layout.hpp"
#include "control/queue/actuator_queue.hpp"
#include "control/queue/purge_tickets.hpp"
#include "control/receiving/batch_plan.hpp"
#include "control/receiving/ledger.hpp"
#include "control/receiving/pool.hpp"
#include "control/receiving/status_sink.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Called by the controller while it takes a batch.
class BatchHandler {
 public:
  /// The iteration about to run; a fresh start inside request() may increase it.
  virtual Iteration iteration() const noexcept = 0;
  /// The epoch that chunks must be of; 0: any.
  virtual std::uint64_t epoch() const noexcept { return 0; }
  /// Serves a request; may call `Controller::restart`. `payload` holds the whole struct. The
  /// request ends with the iteration at which it began: that of the fresh row, if it made one. If
  /// the outcome is active, `Controller::end` ends the record later.
  virtual Outcome request(std::uint32_t lane, CommandId id, BlockIndex record, std::uint32_t index,
                          Cursor payload) noexcept = 0;
  virtual Outcome take_control(std::uint32_t lane) noexcept = 0;
  virtual Outcome release_control(std::uint32_t lane) noexcept = 0;
  /// Clears halts up to this number; may call `Controller::restart`, as a request may.
  /// `accepts`: whatever the readings are.
  virtual Outcome resume(std::uint32_t /*lane*/, CommandId /*id*/, std::uint64_t /*number*/,
                         bool /*accepts*/) noexcept {
    return {};
  }

 protected:
  ~BatchHandler() = default;
};

/// Targets of consecutive iterations that reach the desired states without a batch: what an inline
/// group sends in a burst. They act as one trajectory with a target in each iteration.
struct DirectTargets {
  std::span<const std::uint32_t> actuators;  // each once
  std::uint32_t steps = 0;                   // targets of each actuator
  const std::byte* states = nullptr;  // those of the first actuator, then those of the second, ...
  Mode mode = Mode::queue;
  Iteration first = 0;  // the iteration of the first target

  bool acts(Iteration iteration) const noexcept {
    return iteration >= first && iteration - first < static_cast<Iteration>(steps);
  }
};

/// Position of a number in a block of states that is NaN or infinite.
struct NotFinite {
  std::uint32_t actuator = 0;
  std::uint32_t number = 0;  // index in its state
};

/// Computes the desired states of each iteration from the commands of all lanes.
///
/// Order of calls in an iteration: take() each due batch, step(), then finish_pending() after the
/// row is published. Every record gets exactly one end status. `queued` is not reported: a record
/// without a status in an active batch is queued.
///
/// Writer:   one thread.
/// Realtime: everything but construction; nothing allocates, locks or throws.
class Controller {
 public:
  /// Most statuses of dropped or late commands that are reported in one iteration.
  static constexpr std::uint32_t kStatusesPerIteration = 1024;

  Controller(const Schema& schema, BlockPool& pool, StatusSink& sink, std::uint32_t lanes = 8);
  Controller(const Controller&) = delete;

  /// The first start or a fresh start: sets the desired block to `wanted`, or to `observed` if
  /// that is null. All commands end as purged (fresh_start) at iteration `row`. `follows`: until
  /// the next one, every actuator without a command follows the observed state.
  void restart(const std::byte* observed, const std::byte* wanted, Iteration row,
               bool follows = false) noexcept {
    const std::byte* source = wanted != nullptr ? wanted : observed;
    drop(kEveryActuator, {Status::purged, Reason::fresh_start}, row);
    each(kEveryActuator, [&](std::uint32_t i) { actuators_[i].restart(of(i, source), follows); });
    for (std::uint32_t i = 0; i < actuators_.size(); ++i) set(follow_, i, actuators_[i].follows());
    all_follow_ = follows;
    fresh_row_ = row;
    for (Mask* mask :
         {&active_mask_, &clamped_mask_, &braking_mask_, &starved_mask_, &interrupted_})
      std::ranges::fill(*mask, 0);
    std::ranges::fill(off_plan_, 0.0F);
  }

  /// One more iteration, after restart(), of a motion that was made elsewhere: its desired block.
  void trace(const std::byte* desired) noexcept {
    for (std::uint32_t i = 0; i < actuators_.size(); ++i) actuators_[i].trace(of(i, desired));
  }

  /// Checks about `budget` blocks of a complete batch before it is due, and reduces `budget` by
  /// them. True when all are checked. A lane has its batches checked in turn; take() checks the
  /// rest.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept {
    return planner_.check(lane, batch, budget);
  }
  /// The cost of taking a checked batch.
  Effort effort(BlockIndex batch) const noexcept { return planner_.effort(batch); }
  /// Takes a whole batch at `handler.iteration()`. This overwrites the batch record in the pool:
  /// copy `burst` and `flags` before. A purge also ends later commands with lower tickets.
  void take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept;
  /// Rejects a whole batch instead of taking it. finish_pending() ends its records with `status`.
  void reject(std::uint32_t lane, BlockIndex batch, Reason reason, std::uint8_t detail,
              Iteration iteration, Status status = Status::rejected) noexcept {
    planner_.forget(lane, batch);
    ledger_.reject(lane, batch, {status, reason, detail}, iteration);
  }

  /// Ends a request that was active after take().
  void end(BlockIndex request, const Outcome& outcome, Iteration iteration) noexcept {
    ledger_.end(request, outcome, iteration);
  }

  /// True if none of these actuators has a command: give() may be called.
  bool has_no_command(std::span<const std::uint32_t> actuators) const noexcept {
    return waiting_.empty() && std::ranges::all_of(actuators, [&](std::uint32_t i) {
             return actuators_[i].has_no_command();
           });
  }
  /// Gives targets to the next iterations, as if a batch with a trajectory for each actuator were
  /// taken in iteration `targets.first`. Their memory must outlive these iterations or take_back().
  void give(const DirectTargets& targets) noexcept {
    given_ = targets;
    was_given_ = false;
  }
  void take_back() noexcept { given_.steps = 0; }

  /// Commands => desired. `observed`: the observed block of the last row.
  void step(Iteration iteration, const std::byte* observed) noexcept;

  /// Ends all commands of an actuator, or of kEveryActuator; O(1) for each actuator.
  void purge(std::uint32_t actuator, Iteration iteration, Reason reason = Reason::none) noexcept {
    drop(actuator, {Status::purged, reason}, iteration);
  }
  /// Ends the commands of one lane for an actuator or kEveryActuator; O(lanes) for each actuator.
  void purge_lane(std::uint32_t lane, std::uint32_t actuator, Iteration iteration,
                  Reason reason = Reason::none) noexcept {
    drop_waiting(lane, actuator, {Status::purged, reason}, iteration);
    each(actuator, [&](std::uint32_t i) {
      actuators_[i].drop_lane(lane, {Status::purged, reason}, iteration);
    });
  }
  /// No chunk of this plan of a lane follows, or of any plan of it (ActuatorQueue::kEveryPlan).
  /// Changes no motion; O(actuators).
  void close_plan(std::uint32_t lane, std::uint64_t plan) noexcept;
  /// Earlier purges no longer end commands that are taken later; for an invalid ticket counter.
  void forget_tickets() noexcept { purge_tickets_.forget(); }
  /// Ends all commands as halted; each actuator then brakes within its limits.
  void halt(Iteration iteration) noexcept {
    drop(kEveryActuator, {Status::halted, Reason::halted}, iteration);
  }
  /// Ends all commands of an actuator as interrupted. Targets that have begun no longer reach it.
  /// While every actuator follows, its next command begins where it is observed.
  void interrupt(std::uint32_t actuator, Iteration iteration) noexcept {
    if (was_given_) set(dropped_, actuator);
    drop(actuator, {Status::interrupted}, iteration);
    if (all_follow_) each(actuator, [&](std::uint32_t i) { set(interrupted_, i); });
  }

  /// Reports the end statuses of dropped commands, at most kStatusesPerIteration minus those that
  /// the last step() has reported. False if some are left.
  bool finish_pending() noexcept {
    const std::uint32_t reported = std::exchange(reported_, 0);
    if (!ledger_.pending()) return true;
    ledger_.report_ends(kStatusesPerIteration - std::min(reported, kStatusesPerIteration));
    return !ledger_.pending();
  }

  /// The desired block, in the layout of the schema.
  const std::byte* desired() const noexcept {
    return reinterpret_cast<const std::byte*>(desired_.data());
  }
  /// One bit for each actuator: a command or braking gave the desired state of the last step.
  const std::uint64_t* active_mask() const noexcept { return active_mask_.data(); }
  /// One bit for each actuator: a limit changed the desired state of the last step.
  const std::uint64_t* clamped_mask() const noexcept { return clamped_mask_.data(); }
  /// For each actuator, how far the desired state of the last step is from its plan.
  const float* off_plan() const noexcept { return off_plan_.data(); }
  /// One bit for each actuator: it braked in the last step, without a command.
  const std::uint64_t* braking_mask() const noexcept { return braking_mask_.data(); }
  /// One bit for each actuator: in the last step it had no command and no row of a chunk ahead,
  /// although its plan of chunks is open.
  const std::uint64_t* starved_mask() const noexcept { return starved_mask_.data(); }
  /// Number of steps so far in which an actuator began to be starved.
  std::int64_t starvations() const noexcept { return starvations_; }
  /// True if an actuator without a command is not at rest; O(actuators).
  bool braking() const noexcept {
    // in the last step; or in the next one, for an actuator that has just lost its command
    return std::ranges::any_of(braking_mask_, [](std::uint64_t word) { return word != 0; }) ||
           any([](const ActuatorQueue& queue) { return queue.empty() && !queue.rests(); });
  }
  /// First (order 1) or second difference, to the iteration before, of the number at this offset
  /// of the desired block; 0 for an actuator that was not active, and for what does not move.
  double difference(std::uint32_t offset, std::uint32_t order) const noexcept {
    const auto behind = std::ranges::upper_bound(offsets_, offset);
    if (behind == offsets_.begin()) return 0.0;
    const auto i = static_cast<std::size_t>(behind - offsets_.begin()) - 1;
    if (!masked(active_mask_.data(), i)) return 0.0;
    return actuators_[i].difference(offset - offsets_[i], order);
  }
  /// Number of 64-bit words of a mask.
  std::uint32_t words() const noexcept { return static_cast<std::uint32_t>(active_mask_.size()); }

  /// True if a command is running or queued; O(actuators).
  bool active() const noexcept {
    return !waiting_.empty() || any([](const ActuatorQueue& queue) { return !queue.empty(); });
  }
  /// True if nothing acts, and a restart() with the desired block would change nothing later.
  bool shows_all() noexcept {
    const auto is_zero = [](std::uint64_t word) { return word == 0; };
    return !all_follow_ && std::ranges::all_of(starved_mask_, is_zero) && !pending() &&
           waiting_.empty() && std::ranges::all_of(busy_, is_zero) &&
           std::ranges::all_of(actuators_, &ActuatorQueue::shows_all);
  }
  /// True if a direct value keeps a number away from its rest value; O(actuators).
  bool holds() const noexcept { return any(&ActuatorQueue::holds); }
  /// True if a command of this lane runs or waits, its direct value is held, or its plan of chunks
  /// is open; O(actuators).
  bool acts(std::uint32_t lane) const noexcept {
    return std::ranges::any_of(waiting_, [&](const Waiting& each) { return each.lane == lane; }) ||
           any([&](const ActuatorQueue& queue) { return queue.acts(lane); });
  }
  /// The first number of a block of states that is infinite or NaN, if any; O(numbers).
  std::optional<NotFinite> not_finite(const std::byte* block) const noexcept {
    for (std::uint32_t i = 0; i < actuators_.size(); ++i) {
      const std::uint32_t number = actuators_[i].layout().first_not_finite(of(i, block));
      if (number != StateLayout::kNoNumber) return NotFinite{i, number};
    }
    return std::nullopt;
  }
  /// True if end statuses of dropped commands have not been reported yet.
  bool pending() const noexcept { return ledger_.pending(); }

 private:
  /// The batch that is being taken.
  struct Taking {
    std::uint32_t lane;
    std::uint64_t ticket;
  };
  /// A chunk that was taken and has not begun.
  struct Waiting {
    BlockIndex group;
    std::uint32_t lane;
    Iteration begins;
  };
  static constexpr std::size_t kMaxWaiting = 64;
  static constexpr std::uint32_t kEveryLane = 0xFFFFFFFF;
  void take_chunk(const Taking& from, BlockIndex group, BatchHandler& handler) noexcept;
  Reason decide(const Taking& from, BlockIndex group, Iteration now) noexcept;
  BegunChunk take_over(BlockIndex group, Iteration iteration) noexcept;
  void begin_chunk(BlockIndex group, std::uint32_t lane, Iteration iteration) noexcept;
  /// Ends members of a chunk that has not begun, those with ends(actuator); false if none is left.
  template <class Ends>
  bool drop_members(BlockIndex group, Ends&& ends, const Outcome& outcome,
                    Iteration iteration) noexcept;
  /// The same for all chunks that wait, of one lane or kEveryLane, and begin in `from` or later.
  template <class Ends>
  void drop_waiting(std::uint32_t lane, Ends&& ends, const Outcome& outcome, Iteration iteration,
                    Iteration from) noexcept;
  void drop_waiting(std::uint32_t lane, std::uint32_t actuator, const Outcome& outcome,
                    Iteration iteration) noexcept;
  /// Calls visit(member) for each member of a chunk that has not begun; it may end the member.
  template <class Visit>
  void each_member(BlockIndex group, Visit&& visit) noexcept {
    for (BlockIndex next = pool_.head(group).own[Own::kNext]; next != kNoBlock;) {
      const BlockIndex member = next;
      next = pool_.head(member).own[Own::kNext];
      visit(member);
    }
  }
  /// The next step finds out whether actuators that are starved still are.
  void recheck_starved() noexcept {
    for (std::size_t word = 0; word < busy_.size(); ++word) busy_[word] |= starved_mask_[word];
  }
  bool awaits_chunk(std::uint32_t actuator, bool& known) noexcept;
  void take_step(const Taking& from, BlockIndex record, BatchHandler& handler) noexcept;
  void take_commands(const Taking& from, BlockIndex first, Iteration iteration) noexcept;
  void step_groups(Iteration iteration, const std::byte* observed,
                   std::uint32_t& late_budget) noexcept;
  void step_given(Iteration iteration, const std::byte* observed) noexcept;
  void drop(std::uint32_t actuator, const Outcome& outcome, Iteration iteration) noexcept {
    drop_waiting(kEveryLane, actuator, outcome, iteration);
    each(actuator, [&](std::uint32_t i) { actuators_[i].drop(outcome, iteration); });
  }
  const std::byte* of(std::uint32_t actuator, const std::byte* block) const noexcept {
    return block + offsets_[actuator];
  }
  template <class Predicate>
  bool any(Predicate predicate) const noexcept {
    return std::ranges::any_of(actuators_, predicate);
  }
  /// Calls `visit(index)`, which drops commands, for one actuator or kEveryActuator: now busy.
  template <class Visit>
  void each(std::uint32_t actuator, Visit&& visit) noexcept {
    const auto last = static_cast<std::uint32_t>(actuators_.size());
    for (std::uint32_t i = actuator == kEveryActuator ? 0 : actuator; i < last; ++i) {
      O80_COUNT(queue_dropped);
      visit(i);
      set(busy_, i);
      if (actuator != kEveryActuator) return;
    }
  }

  /// One bit for each actuator.
  using Mask = std::vector<std::uint64_t>;
  static void set(Mask& mask, std::size_t i, bool to = true) noexcept {
    const std::uint64_t bit = std::uint64_t{1} << (i % 64);
    mask[i / 64] = to ? mask[i / 64] | bit : mask[i / 64] & ~bit;
  }

  BlockPool& pool_;
  StatusSink& sink_;
  Ledger ledger_;
  Layouts layouts_;
  BatchPlanner planner_;
  PurgeTickets purge_tickets_;
  std::vector<Block> desired_;
  std::vector<float> off_plan_;
  std::vector<ChunkStart> starts_;  // of a chunk that begins
  Mask active_mask_;
  Mask clamped_mask_;
  Mask braking_mask_;
  Mask starved_mask_;  // of actuators that are not busy: as in the step before
  std::int64_t starvations_ = 0;
  std::vector<std::uint32_t> offsets_;  // offset of each actuator in a block of states [bytes]
  std::vector<ActuatorQueue> actuators_;
  Mask busy_;                     // has commands, or is not known to be at rest
  Mask stepped_;                  // has its desired state from given_ already
  Mask follow_;                   // follows the observed state when idle
  bool all_follow_ = false;       // since the last fresh start, whatever the schema says
  Mask interrupted_;              // while all follow: since the last step
  std::vector<Waiting> waiting_;  // in the order in which they begin
  Mask of_chunk_;                 // actuators of the chunk that is being taken, or of all that wait
  Iteration fresh_row_ = 0;       // of the last fresh start
  DirectTargets given_;
  Mask dropped_;                // no longer gets its targets
  bool was_given_ = false;      // the first target of given_
  std::uint32_t reported_ = 0;  // statuses reported by the last step()
};

}  // namespace o80
