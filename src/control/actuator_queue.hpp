#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "control/duration.hpp"
#include "control/lane_lists.hpp"
#include "control/ledger.hpp"
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
  /// Then: true if its members begin in this iteration, and this actuator has no motion.
  bool begins_group(Iteration iteration) const noexcept {
    if (running_ || queue_.empty()) return false;
    const RecordHead& head = pool_->head(queue_.front());
    return is_member(head) && ledger_->groups().is_complete(head, iteration);
  }
  /// Then, if all members have arrived: takes the largest carry of durations.
  void agree_on_carry(Iteration iteration) noexcept;
  /// Then, if all members have arrived: proposes its number of iterations. The largest is used.
  void plan_with_others(Iteration iteration, const std::byte* observed) noexcept;
  /// `late_budget`: number of late commands that may still be rejected in this iteration.
  Moved step(Iteration iteration, const std::byte* observed, std::uint32_t& late_budget) noexcept;
  /// True if no command or given target is running or queued.
  bool empty() const noexcept { return queue_.empty() && !running_; }
  bool has_no_command() const noexcept { return queue_.empty() && (!running_ || is_given()); }
  /// For targets that are given without a command, to a queue that has none: begins a row of them.
  void begin_given(Mode mode) noexcept;
  /// Then, in each iteration: goes to the next one, as a direct command would. The last one stays
  /// in force.
  Moved go_to(Iteration iteration, const std::byte* observed, const std::byte* target) noexcept;
  /// True if a direct value keeps a number away from its rest value.
  bool holds() const noexcept { return motion_.holds(); }
  /// True if an iteration without a command would change nothing.
  bool at_rest() const noexcept {
    return follows() ? motion_.resting_at_rest() : motion_.at_rest();
  }
  /// True if nothing moves.
  bool rests() const noexcept { return follows() ? motion_.resting_at_rest() : motion_.rests(); }
  /// True if a command of this lane is queued or running, or its direct value is still held.
  bool acts(std::uint32_t lane) const noexcept {
    return queue_.has(lane) || (alone_ != kNoBlock && ledger_->lane_of(alone_) == lane) ||
           (holder_ == lane && holds());
  }

  /// Sets the desired state, at rest. Numbers that are not finite keep their last desired value.
  void restart(const std::byte* state) noexcept;
  /// One more iteration, after restart(), of a motion that was made elsewhere.
  void trace(const std::byte* state) noexcept {
    layout_->copy_finite(desired_, state);
    motion_.trace(desired_);
  }
  /// For an idle actuator that follows: the observed state becomes the desired one, except for
  /// numbers with a rest value, which go to it. True while one of these moves.
  bool follow(const std::byte* observed) noexcept;
  bool follows() const noexcept { return when_idle_ == WhenIdle::follow; }
  /// As Motion::difference().
  double difference(std::uint32_t offset, std::uint32_t order) const noexcept {
    return motion_.difference(offset, order);
  }

 private:
  /// What a direct command, or a given target, is: an equal one behind it changes nothing.
  struct SetPoint {
    Profile profile = Profile::linear;
    Start start = Start::desired;
    std::int64_t every = 0;  // [ns]
    bool masked = false;
    bool operator==(const SetPoint&) const = default;
  };

  bool begin_next(Iteration iteration, const std::byte* observed,
                  std::uint32_t& late_budget) noexcept;
  bool end_late(Iteration iteration, std::uint32_t& late_budget) noexcept;
  bool may_give_way() const noexcept { return running_ && (alone_ != kNoBlock || given_); }
  bool gives_way_to(const RecordHead& next) const noexcept;
  void give_way(Iteration iteration) noexcept;
  bool is_in_force(const RecordHead& head, BlockIndex record) noexcept;
  void begin_command(const std::byte* observed) noexcept;
  bool begin_row(Iteration iteration) noexcept;
  void plan_row(Iteration iteration) noexcept;
  void read_row() noexcept;
  void next_set_point() noexcept;
  void look_ahead() noexcept;
  Motion::Course course(const RecordHead& head, Iteration iteration) noexcept;
  std::int64_t row_of_own_time() noexcept;
  void end_running(Iteration iteration) noexcept;
  void end_held_back(Iteration iteration, const Limited& bound) noexcept;
  void take_out() noexcept;
  BlockIndex running_record() const noexcept {
    return alone_ != kNoBlock ? alone_ : queue_.front();
  }
  bool is_given() const noexcept { return running_ && given_; }
  Moved come_to_rest(const std::byte* observed) noexcept;
  void end_motion() noexcept;
  const std::uint64_t* mask() const noexcept { return masked_ ? mask_.data() : nullptr; }

  const StateLayout* layout_;
  BlockPool* pool_;
  Ledger* ledger_;
  std::byte* desired_;
  Motion motion_;
  DurationCarry carry_;
  double period_;  // [s]
  Profile usual_profile_;
  WhenIdle when_idle_;

  LaneLists queue_;  // the front is the running command, if `running_` and not `alone_` or `given_`
  bool running_ = false;
  // the running command that may give way to its successor: taken out of the queue
  BlockIndex alone_ = kNoBlock;
  bool given_ = false;        // a given target is in force, without a record
  std::uint32_t holder_ = 0;  // lane that gave the direct value that stays

  // the set-point in force: of the running command, or of the last one if nothing came after it
  bool in_force_ = false;
  SetPoint set_point_;

  // the running command
  Pace pace_ = Pace::direct;
  std::uint32_t rows_left_ = 0;
  bool masked_ = false;
  bool timed_ = false;
  bool is_trajectory_ = false;
  bool keeps_plan_ = false;          // a set-point equal to the one in force
  bool begun_ = false;               // reported as active
  bool planned_ = false;             // plan_with_others() has planned its next waypoint
  std::int64_t row_iterations_ = 1;  // iterations of the planned waypoint
  std::int64_t asked_ = 0;           // of these, those that were asked for; 0: none
  std::int64_t late_ = 0;            // iterations more than asked
  Limited reason_;                   // for these
  std::int64_t time_ = 0;            // end time of the last waypoint [ns]
  Cursor times_;
  Cursor rows_;
  Cursor ahead_;  // next row of a trajectory whose span is not known yet
  std::uint32_t ahead_left_ = 0;
  std::vector<std::uint64_t> mask_;
  std::vector<std::uint64_t> next_mask_;
  std::vector<std::uint64_t> scratch_;  // space for a state
};

}  // namespace o80
