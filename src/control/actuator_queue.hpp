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

/// The commands of one actuator, first in first out, and the motion of the one that runs.
///
/// Realtime: everything but construction.
class ActuatorQueue {
 public:
  /// What an iteration gave the desired state.
  enum class Moved : std::uint8_t {
    idle,     // nothing: no command is left, and it rests
    braking,  // no command: it comes to rest
    active,
    clamped
  };

  /// `desired` is the actuator's own place in the desired block.
  ActuatorQueue(const Schema& schema, const ActuatorRow& row, const StateLayout& layout,
                BlockPool& pool, Ledger& ledger, std::byte* desired, std::uint32_t lanes);

  /// Adds a list of commands of one lane.
  void append(BlockIndex first, BlockIndex last, std::uint32_t lane) noexcept {
    queue_.append(first, last, lane);
  }
  /// Ends everything; what overwrites it may continue its motion.
  void drop(Status status, Reason reason, Iteration iteration) noexcept;
  /// Ends what one lane sent, the direct value it gave last included.
  void drop_lane(std::uint32_t lane, Status status, Reason reason, Iteration iteration) noexcept;
  /// What queues do for commands of several actuators before any of them steps: all tell when such
  /// a command is their next, then all whose group is complete plan their next row, so that the
  /// slowest decides how many iterations it takes.
  void arrive(Iteration iteration, std::uint32_t& late_budget) noexcept;
  void plan_with_others(Iteration iteration, const std::byte* observed) noexcept;
  /// `late_budget` is how many late commands may still be told in this iteration.
  Moved step(Iteration iteration, const std::byte* observed, std::uint32_t& late_budget) noexcept;
  bool empty() const noexcept { return queue_.empty(); }
  /// A direct value keeps a resting number away from its rest until something takes its place.
  bool holds() const noexcept { return limiter_.holds(); }
  /// An iteration without a command would not move it.
  bool at_rest() const noexcept {
    return follows() ? limiter_.resting_at_rest() : limiter_.at_rest();
  }
  /// A command of this lane, or the direct value it gave last, still acts.
  bool acts(std::uint32_t lane) const noexcept {
    return queue_.has(lane) || (holder_ == lane && holds());
  }

  /// Begins at rest in this state; what is no finite number keeps its last desired value.
  void restart(const std::byte* state) noexcept;
  /// The state of an actuator that follows, as long as it is idle: what was observed, but for the
  /// numbers that rest. True while one of these moves.
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

  LaneLists queue_;  // in front the one that runs, if one does
  bool running_ = false;
  Limited limited_;           // by the last iteration
  std::uint32_t holder_ = 0;  // lane that gave the direct value that stays
  bool streams_ = false;      // the iteration before was a direct command's

  // of the command that runs
  Pace pace_ = Pace::direct;
  double most_ =
      std::numeric_limits<double>::infinity();  // speed of its first number [1/iteration]
  std::uint32_t first_number_ = 0;              // that it commands
  std::uint32_t rows_left_ = 0;
  bool masked_ = false;
  bool timed_ = false;
  bool first_row_ = false;
  bool planned_ = false;             // its next row, with those of its group
  std::int64_t row_iterations_ = 1;  // of the row that is planned
  std::int64_t time_ = 0;            // end of the last row [ns]
  Cursor times_;
  Cursor rows_;
  std::vector<std::uint64_t> mask_;
  std::vector<std::uint64_t> scratch_;  // a state
  std::vector<std::uint64_t> spare_;    // likewise
};

}  // namespace o80
