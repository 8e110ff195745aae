#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "o80/control/clamp.hpp"
#include "o80/control/duration.hpp"
#include "o80/control/lane_lists.hpp"
#include "o80/control/ledger.hpp"
#include "o80/control/motion.hpp"
#include "o80/control/pool.hpp"
#include "o80/control/state_layout.hpp"

namespace o80 {

/// The commands of one actuator, first in first out, and the motion of the one that runs.
///
/// Realtime: everything but construction.
class ActuatorQueue {
 public:
  /// What an iteration gave the desired state.
  enum class Moved : std::uint8_t {
    idle,     // nothing: no command is left
    waiting,  // nothing yet: late commands in a row used up the iteration's share of work
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
  /// Ends what one lane sent.
  void drop_lane(std::uint32_t lane, Status status, Reason reason, Iteration iteration) noexcept;
  /// `late_budget` is how many late commands may still be told in this iteration.
  Moved step(Iteration iteration, const std::byte* observed, std::uint32_t& late_budget) noexcept;
  bool empty() const noexcept { return queue_.empty(); }

  /// The state of an actuator that has just become idle.
  void settle(const std::byte* observed) noexcept;
  /// The state of an actuator that follows, as long as it is idle.
  void follow(const std::byte* observed) noexcept { layout_->copy(desired_, observed); }
  bool follows() const noexcept { return when_idle_ == WhenIdle::follow; }

 private:
  bool begin_next(Iteration iteration, const std::byte* observed,
                  std::uint32_t& late_budget) noexcept;
  void begin_row(Iteration iteration, const std::byte* observed) noexcept;
  std::int64_t iterations(const RecordHead& head, Iteration iteration) noexcept;
  std::int64_t iterations_at(double speed, Profile profile) noexcept;
  void end_running(Iteration iteration) noexcept;
  void halt() noexcept;

  const StateLayout* layout_;
  BlockPool* pool_;
  Ledger* ledger_;
  std::byte* desired_;
  Motion motion_;
  Clamp clamp_;
  DurationCarry carry_;
  double period_;  // [s]
  WhenIdle when_idle_;

  LaneLists queue_;  // in front the one that runs, if one does
  bool running_ = false;
  bool clamped_ = false;  // by the last iteration

  // of the command that runs
  std::uint32_t rows_left_ = 0;
  bool partial_ = false;
  bool timed_ = false;
  bool first_row_ = false;
  std::int64_t time_ = 0;  // end of the last row [ns]
  Cursor times_;
  Cursor rows_;
  std::vector<std::uint64_t> mask_;
  std::vector<std::uint64_t> scratch_;  // a state
};

}  // namespace o80
