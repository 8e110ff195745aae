#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "control/actuator_queue.hpp"
#include "control/batch_handler.hpp"
#include "control/batch_plan.hpp"
#include "control/direct_targets.hpp"
#include "control/ledger.hpp"
#include "control/pool.hpp"
#include "control/purge_tickets.hpp"
#include "control/record.hpp"
#include "control/state_layout.hpp"
#include "control/status_sink.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

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
  Controller& operator=(const Controller&) = delete;

  /// The first start or a fresh start: sets the desired block to `desired`, or to `observed` if
  /// that is null. All commands end as purged (fresh_start) at iteration `row`.
  void restart(const std::byte* observed, const std::byte* desired, Iteration row) noexcept;

  /// One more iteration, after restart(), of a motion that was made elsewhere: its desired block.
  void trace(const std::byte* desired) noexcept {
    for (std::uint32_t i = 0; i < actuators_.size(); ++i) actuators_[i].trace(of(i, desired));
  }

  /// Checks the records of a complete batch in the pool before it is due, about `budget` blocks,
  /// and reduces `budget` by them. True when all are checked. The batches of one lane are checked
  /// one after the other. take() checks the rest.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept {
    return planner_.check(lane, batch, budget);
  }
  /// The cost of taking a checked batch.
  Effort effort(BlockIndex batch) const noexcept { return planner_.effort(batch); }
  /// Takes a whole batch at `handler.iteration()`. This overwrites the batch record in the pool:
  /// copy `burst` and `flags` before. A purge also ends commands with lower tickets that are taken
  /// later.
  void take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept;
  /// Rejects a whole batch instead of taking it. finish_pending() ends its records with `status`.
  void reject(std::uint32_t lane, BlockIndex batch, Reason reason, std::uint8_t detail,
              Iteration iteration, Status status = Status::rejected) noexcept;

  /// Ends a request that was active after take().
  void end(BlockIndex request, const Outcome& outcome, Iteration iteration) noexcept {
    ledger_.end(request, outcome.status, outcome.reason, outcome.detail, iteration);
  }

  /// True if none of these actuators has a command: give() may be called.
  bool has_no_command(std::span<const std::uint32_t> actuators) const noexcept;
  /// Gives targets to the next iterations, as if a batch with a trajectory for each actuator were
  /// taken in iteration `targets.first`. Their memory must outlive those iterations, or
  /// take_back().
  void give(const DirectTargets& targets) noexcept {
    given_ = targets;
    was_given_ = false;
  }
  void take_back() noexcept { given_.steps = 0; }

  /// Commands => desired. `observed`: the observed block of the last row.
  void step(Iteration iteration, const std::byte* observed) noexcept;

  /// Ends all commands of an actuator, or of kEveryActuator; O(1) for each actuator.
  void purge(std::uint32_t actuator, Iteration iteration, Reason reason = Reason::none) noexcept;
  /// Ends the commands that one lane has sent to an actuator, or to kEveryActuator; O(lanes) for
  /// each actuator.
  void purge_lane(std::uint32_t lane, std::uint32_t actuator, Iteration iteration,
                  Reason reason = Reason::none) noexcept;
  /// Earlier purges no longer end commands that are taken later; for an invalid ticket counter.
  void forget_tickets() noexcept { purge_tickets_.forget(); }
  /// Ends all commands as halted; each actuator then brakes within its limits.
  void halt(Iteration iteration) noexcept;
  /// Ends all commands of an actuator as interrupted.
  void interrupt(std::uint32_t actuator, Iteration iteration) noexcept;

  /// Reports the end statuses of dropped commands, at most kStatusesPerIteration minus those that
  /// the last step() has reported. False if some are left.
  bool finish_pending() noexcept {
    if (ledger_.pending()) return finish_all_pending();
    told_ = 0;
    return true;
  }

  /// The desired block, in the layout of the schema.
  const std::byte* desired() const noexcept {
    return reinterpret_cast<const std::byte*>(desired_.data());
  }
  /// One bit for each actuator: a command or braking gave the desired state of the last step.
  const std::uint64_t* active_mask() const noexcept { return active_mask_.data(); }
  /// One bit for each actuator: a limit changed the desired state of the last step.
  const std::uint64_t* clamped_mask() const noexcept { return clamped_mask_.data(); }
  /// One bit for each actuator: it braked in the last step, without a command.
  const std::uint64_t* braking_mask() const noexcept { return braking_mask_.data(); }
  /// True if an actuator without a command is not at rest; O(actuators).
  bool braking() const noexcept;
  /// First (order 1) or second difference, to the iteration before, of the number at this offset
  /// of the desired block; 0 for an actuator that was not active, and for what does not move.
  double difference(std::uint32_t offset, std::uint32_t order) const noexcept;
  /// Number of 64-bit words of a mask.
  std::uint32_t words() const noexcept { return static_cast<std::uint32_t>(active_mask_.size()); }

  /// True if a command is running or queued; O(actuators).
  bool active() const noexcept;
  /// True if a direct value keeps a number away from its rest value; O(actuators).
  bool holds() const noexcept;
  /// True if a command of this lane is running or queued, or its direct value is still held;
  /// O(actuators).
  bool acts(std::uint32_t lane) const noexcept;
  /// The first number of a block of states that is infinite or NaN, if any; O(numbers).
  std::optional<NotFinite> not_finite(const std::byte* block) const noexcept;
  /// True if end statuses of dropped commands have not been reported yet.
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
  bool finish_all_pending() noexcept;
  void step_given(Iteration iteration, const std::byte* observed) noexcept;
  void forget_given(std::uint32_t actuator) noexcept;
  const std::byte* of(std::uint32_t actuator, const std::byte* block) const noexcept {
    return block + offsets_[actuator];
  }
  /// Calls `visit(ActuatorQueue&)` for one actuator or kEveryActuator, and marks them as busy.
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
  StatusSink& sink_;
  Ledger ledger_;
  std::vector<std::optional<StateLayout>> layouts_;  // one for each type of the schema
  BatchPlanner planner_;
  PurgeTickets purge_tickets_;
  std::vector<Block> desired_;
  std::vector<std::uint64_t> active_mask_;
  std::vector<std::uint64_t> clamped_mask_;
  std::vector<std::uint64_t> braking_mask_;
  std::vector<std::uint32_t> offsets_;     // offset of each actuator in a block of states [bytes]
  std::vector<const StateLayout*> types_;  // layout of each actuator
  std::vector<ActuatorQueue> actuators_;
  std::vector<std::uint64_t> busy_;     // mask: has commands, or is not known to be at rest
  std::vector<std::uint64_t> stepped_;  // mask: has its desired state from given_ already
  std::vector<std::uint64_t> follow_;   // mask: follows the observed state when idle
  DirectTargets given_;
  std::vector<std::uint64_t> dropped_;  // mask: no longer gets its targets
  bool was_given_ = false;              // the first target of given_
  std::uint32_t told_ = 0;              // statuses reported by the last step()
};

}  // namespace o80
