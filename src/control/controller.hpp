#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "control/actuator_queue.hpp"
#include "control/batch_handler.hpp"
#include "control/batch_plan.hpp"
#include "control/ledger.hpp"
#include "control/pool.hpp"
#include "control/purge_tickets.hpp"
#include "control/record.hpp"
#include "control/state_layout.hpp"
#include "control/status_sink.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// A number that is none, in a block of states.
struct NotFinite {
  std::uint32_t actuator = 0;
  std::uint32_t number = 0;  // of its state
};

/// Turns the commands of all lanes into desired states, one iteration after the other.
///
/// Its order in an iteration: `take` what is due, `step`, then `finish_pending` once the row is
/// out. Every record ends with exactly one end status (`queued` is not told: a record of a batch
/// that is active and has no status yet is queued). The schema's rows are copied.
///
/// Writer:   one thread.
/// Realtime: everything but construction; nothing allocates, locks or throws.
class Controller {
 public:
  /// Statuses of dropped or late commands told in one iteration, at most.
  static constexpr std::uint32_t kStatusesPerIteration = 1024;

  Controller(const Schema& schema, BlockPool& pool, StatusSink& sink, std::uint32_t lanes = 8);
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// Begins, or begins afresh: desired becomes `desired`, or `observed` where that is null, and all
  /// that was queued ends purged (fresh_start) at iteration `row`.
  void restart(const std::byte* observed, const std::byte* desired, Iteration row) noexcept;

  /// Checks the records of a batch that is complete in the pool but not yet due, about `budget`
  /// blocks a call, which it takes off; true when all are. Batches of one lane are checked one
  /// after the other. `take` does what is left of it.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept {
    return planner_.check(lane, batch, budget);
  }
  /// What taking a checked batch takes of an iteration.
  Effort effort(BlockIndex batch) const noexcept { return planner_.effort(batch); }
  /// Takes a whole batch at `handler.iteration()`. The batch record in the pool is the
  /// controller's from here on: copy `burst` and `flags` before. A purge also ends commands with
  /// tickets below the batch's that are taken later.
  void take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept;
  /// Ends a whole batch, never taken, as rejected; its records follow in `finish_pending`, with
  /// this status.
  void reject(std::uint32_t lane, BlockIndex batch, Reason reason, std::uint8_t detail,
              Iteration iteration, Status status = Status::rejected) noexcept;

  /// Ends a request that was left active when its batch was taken.
  void end(BlockIndex request, const Outcome& outcome, Iteration iteration) noexcept {
    ledger_.end(request, outcome.status, outcome.reason, outcome.detail, iteration);
  }

  /// Commands => desired. `observed` is the last row's.
  void step(Iteration iteration, const std::byte* observed) noexcept;

  /// Drops what an actuator (or kEveryActuator) runs and queues; O(1) an actuator.
  void purge(std::uint32_t actuator, Iteration iteration, Reason reason = Reason::none) noexcept;
  /// Drops what one lane sent, to an actuator or to every one; O(lanes) an actuator.
  void purge_lane(std::uint32_t lane, std::uint32_t actuator, Iteration iteration,
                  Reason reason = Reason::none) noexcept;
  /// Purges that were taken no longer end what is taken later: tickets begin anew.
  void forget_tickets() noexcept { purge_tickets_.forget(); }
  /// Ends everything as halted; each actuator then brakes within its limits.
  void halt(Iteration iteration) noexcept;
  /// Ends what an actuator runs and queues as interrupted.
  void interrupt(std::uint32_t actuator, Iteration iteration) noexcept;

  /// Tells the statuses of what was dropped, at most kStatusesPerIteration a call (less what the
  /// last step spent on late commands); false when some are left.
  bool finish_pending() noexcept;

  /// The desired block, as the schema lays it out.
  const std::byte* desired() const noexcept {
    return reinterpret_cast<const std::byte*>(desired_.data());
  }
  /// One bit an actuator, in whole words: a command gave the desired state of the last step.
  const std::uint64_t* active_mask() const noexcept { return active_mask_.data(); }
  /// One bit an actuator, in whole words: the last step clamped it.
  const std::uint64_t* clamped_mask() const noexcept { return clamped_mask_.data(); }
  /// One bit an actuator, in whole words: the last step brought it to rest, without a command.
  const std::uint64_t* braking_mask() const noexcept { return braking_mask_.data(); }
  /// Some actuator has no command and has not come to rest; O(actuators).
  bool braking() const noexcept;
  /// Words of a mask.
  std::uint32_t words() const noexcept { return static_cast<std::uint32_t>(active_mask_.size()); }

  /// Something runs or is queued.
  bool active() const noexcept;
  /// Some direct value stays until something takes its place; O(actuators).
  bool holds() const noexcept;
  /// A command of this lane, or a direct value that it gave last, still acts; O(actuators).
  bool acts(std::uint32_t lane) const noexcept;
  /// The first number of a block of states that is infinite or NaN; O(numbers).
  std::optional<NotFinite> not_finite(const std::byte* block) const noexcept;
  /// Something dropped is still to be told.
  bool pending() const noexcept { return ledger_.pending(); }

 private:
  /// The batch that is being taken.
  struct Taking {
    std::uint32_t lane;
    std::uint64_t ticket;
  };
  void take_step(const Taking& from, BlockIndex record, BatchHandler& handler) noexcept;
  void take_commands(const Taking& from, BlockIndex first, Iteration iteration) noexcept;
  void take_purge(const Taking& from, const RecordHead& head, Iteration iteration) noexcept;
  void step_groups(Iteration iteration, const std::byte* observed,
                   std::uint32_t& late_budget) noexcept;
  const std::byte* of(std::uint32_t actuator, const std::byte* block) const noexcept {
    return block + offsets_[actuator];
  }
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

  BlockPool& pool_;
  Ledger ledger_;
  std::vector<std::optional<StateLayout>> layouts_;  // of each type of the schema
  BatchPlanner planner_;
  PurgeTickets purge_tickets_;
  std::vector<Block> desired_;
  std::vector<std::uint64_t> active_mask_;
  std::vector<std::uint64_t> clamped_mask_;
  std::vector<std::uint64_t> braking_mask_;
  std::vector<std::uint32_t> offsets_;     // of each actuator, in a block of states
  std::vector<const StateLayout*> types_;  // of each actuator
  std::vector<ActuatorQueue> actuators_;
  std::vector<std::uint64_t> busy_;    // has commands, or has just lost its last
  std::vector<std::uint64_t> follow_;  // follows when idle
  std::uint32_t told_ = 0;             // statuses, in the last step
};

}  // namespace o80
