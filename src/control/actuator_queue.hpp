#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "control/duration.hpp"
#include "control/lane_lists.hpp"
#include "control/ledger.hpp"
#include "control/limiter.hpp"
#include "control/motion.hpp"
#include "control/pool.hpp"
#include "control/state_layout.hpp"

namespace o80 {

/// The queue of the commands of one actuator, and the motion of the running one.
///
/// Realtime: everything but construction.
class ActuatorQueue {
 public:
  /// How the desired state of an iteration was computed.
  enum class Moved : std::uint8_t {
    idle,     // no command; at rest
    braking,  // no command; it comes to rest
    active,   // by a command
    clamped   // by a command, changed by a limit
  };

  /// `desired`: the state of this actuator in the desired block.
  ActuatorQueue(const Schema& schema, const ActuatorRow& row, const StateLayout& layout,
                BlockPool& pool, Ledger& ledger, std::byte* desired, std::uint32_t lanes);

  /// Adds a list of commands of one lane.
  void append(BlockIndex first, BlockIndex last, std::uint32_t lane) noexcept {
    queue_.append(first, last, lane);
  }
  /// Ends all commands. With Status::overwritten the next command may continue the motion.
  void drop(Status status, Reason reason, Iteration iteration) noexcept;
  /// Ends the commands of one lane, and releases a direct value that this lane has set.
  void drop_lane(std::uint32_t lane, Status status, Reason reason, Iteration iteration) noexcept;
  /// For commands of several actuators (ARCHITECTURE.md, Commands of several actuators); called for
  /// all queues before any step(). Reports that the next command is a member of a group.
  void arrive(Iteration iteration, std::uint32_t& late_budget) noexcept;
  /// Then, if all members have arrived: proposes its number of iterations. The largest is used.
  void plan_with_others(Iteration iteration, const std::byte* observed) noexcept;
  /// `late_budget`: number of late commands that may still be rejected in this iteration.
  Moved step(Iteration iteration, const std::byte* observed, std::uint32_t& late_budget) noexcept;
  bool empty() const noexcept { return queue_.empty(); }
  bool has_no_command() const noexcept { return queue_.empty() && !running_; }
  /// For targets that are given without a command, to a queue that has none: begins a row of them.
  void begin_given(Mode mode) noexcept;
  /// Then, in each iteration: goes to the next one, as a command of one iteration would.
  Moved go_to(const std::byte* target) noexcept;
  /// True if a direct value keeps a number away from its rest value.
  bool holds() const noexcept { return limiter_.holds(); }
  /// True if an iteration without a command would change nothing.
  bool at_rest() const noexcept {
    return follows() ? limiter_.resting_at_rest() : limiter_.at_rest();
  }
  /// True if a command of this lane is queued or running, or its direct value is still held.
  bool acts(std::uint32_t lane) const noexcept {
    return queue_.has(lane) || (holder_ == lane && holds());
  }

  /// Sets the desired state, at rest. Numbers that are not finite keep their last desired value.
  void restart(const std::byte* state) noexcept;
  /// For an idle actuator that follows: the observed state becomes the desired one, except for
  /// numbers with a rest value, which go to it. True while one of these moves.
  bool follow(const std::byte* observed) noexcept;
  bool follows() const noexcept { return when_idle_ == WhenIdle::follow; }

 private:
  bool begin_next(Iteration iteration, const std::byte* observed,
                  std::uint32_t& late_budget) noexcept;
  bool end_late(Iteration iteration, std::uint32_t& late_budget) noexcept;
  void begin_command(Iteration iteration) noexcept;
  void begin_row(Iteration iteration, const std::byte* observed) noexcept;
  void plan_row(Iteration iteration, const std::byte* observed) noexcept;
  bool read_row() noexcept;
  std::int64_t iterations(const RecordHead& head, Iteration iteration) noexcept;
  std::int64_t iterations_at(double speed, Profile profile) noexcept;
  std::int64_t row_of_own_time() noexcept;
  Limited move(Iteration iteration) noexcept;
  void end_running(Iteration iteration) noexcept;
  Moved come_to_rest(const std::byte* observed) noexcept;
  void keep_moving() noexcept;
  void end_motion() noexcept;
  const std::uint64_t* mask() const noexcept { return masked_ ? mask_.data() : nullptr; }

  const StateLayout* layout_;
  BlockPool* pool_;
  Ledger* ledger_;
  std::byte* desired_;
  Motion motion_;
  Limiter limiter_;
  DurationCarry carry_;
  double period_;  // [s]
  WhenIdle when_idle_;

  LaneLists queue_;  // the front is the running command, if `running_`
  bool running_ = false;
  Limited limited_;           // in the last iteration
  std::uint32_t holder_ = 0;  // lane that gave the direct value that stays
  bool streams_ = false;      // the iteration before was a direct command's

  // the running command
  Pace pace_ = Pace::direct;
  double most_ =
      std::numeric_limits<double>::infinity();  // speed of its first number [1/iteration]
  std::uint32_t first_number_ = 0;              // its first commanded number
  std::uint32_t rows_left_ = 0;
  bool masked_ = false;
  bool timed_ = false;
  bool first_row_ = false;
  bool planned_ = false;             // plan_with_others() has planned its next waypoint
  std::int64_t row_iterations_ = 1;  // iterations of the planned waypoint
  std::int64_t time_ = 0;            // end time of the last waypoint [ns]
  Cursor times_;
  Cursor rows_;
  std::vector<std::uint64_t> mask_;
  std::vector<std::uint64_t> scratch_;  // space for a state
  std::vector<std::uint64_t> spare_;    // space for a state
};

}  // namespace o80
