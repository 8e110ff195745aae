#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "control/batch_handler.hpp"
#include "control/batch_plan.hpp"
#include "control/pool.hpp"
#include "control/record.hpp"
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
  ~Controller();

  /// Begins, or begins afresh: desired becomes `desired`, or `observed` where that is null, and all
  /// that was queued ends purged (fresh_start) at iteration `row`.
  void restart(const std::byte* observed, const std::byte* desired, Iteration row) noexcept;

  /// Checks the records of a batch that is complete in the pool but not yet due, about `budget`
  /// blocks a call, which it takes off; true when all are. Batches of one lane are checked one
  /// after the other. `take` does what is left of it.
  bool check(std::uint32_t lane, BlockIndex batch, std::uint32_t& budget) noexcept;
  /// What taking a checked batch takes of an iteration.
  Effort effort(BlockIndex batch) const noexcept;
  /// Takes a whole batch at `handler.iteration()`. The batch record in the pool is the
  /// controller's from here on: copy `burst` and `flags` before. A purge also ends commands with
  /// tickets below the batch's that are taken later.
  void take(std::uint32_t lane, BlockIndex batch, BatchHandler& handler) noexcept;
  /// Ends a whole batch, never taken, as rejected; its records follow in `finish_pending`, with
  /// this status.
  void reject(std::uint32_t lane, BlockIndex batch, Reason reason, std::uint8_t aux,
              Iteration iteration, Status status = Status::rejected) noexcept;

  /// Ends a request that was left active when its batch was taken.
  void end(BlockIndex request, const Outcome& outcome, Iteration iteration) noexcept;

  /// Commands => desired. `observed` is the last row's.
  void step(Iteration iteration, const std::byte* observed) noexcept;

  /// Drops what an actuator (or kEveryActuator) runs and queues; O(1) an actuator.
  void purge(std::uint32_t actuator, Iteration iteration, Reason reason = Reason::none) noexcept;
  /// Drops what one lane sent, to an actuator or to every one; O(lanes) an actuator.
  void purge_lane(std::uint32_t lane, std::uint32_t actuator, Iteration iteration,
                  Reason reason = Reason::none) noexcept;
  /// Purges that were taken no longer end what is taken later: tickets begin anew.
  void forget_tickets() noexcept;
  /// Ends everything as halted; each actuator then brakes within its limits.
  void halt(Iteration iteration) noexcept;
  /// Ends what an actuator runs and queues as interrupted.
  void interrupt(std::uint32_t actuator, Iteration iteration) noexcept;

  /// Tells the statuses of what was dropped, at most kStatusesPerIteration a call (less what the
  /// last step spent on late commands); false when some are left.
  bool finish_pending() noexcept;

  /// The desired block, as the schema lays it out.
  const std::byte* desired() const noexcept;
  /// One bit an actuator, in whole words: a command gave the desired state of the last step.
  const std::uint64_t* active_mask() const noexcept;
  /// One bit an actuator, in whole words: the last step clamped it.
  const std::uint64_t* clamped_mask() const noexcept;
  /// One bit an actuator, in whole words: the last step brought it to rest, without a command.
  const std::uint64_t* braking_mask() const noexcept;
  /// Some actuator has no command and has not come to rest; O(actuators).
  bool braking() const noexcept;
  /// Words of a mask.
  std::uint32_t words() const noexcept;

  /// Something runs or is queued.
  bool active() const noexcept;
  /// Some direct value stays until something takes its place; O(actuators).
  bool holds() const noexcept;
  /// A command of this lane, or a direct value that it gave last, still acts; O(actuators).
  bool acts(std::uint32_t lane) const noexcept;
  /// The first number of a block of states that is infinite or NaN; O(numbers).
  std::optional<NotFinite> not_finite(const std::byte* block) const noexcept;
  /// Something dropped is still to be told.
  bool pending() const noexcept;

 private:
  class Body;
  std::unique_ptr<Body> body_;
};

}  // namespace o80
