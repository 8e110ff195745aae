#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "control/motion/duration.hpp"
#include "control/motion/motion.hpp"
#include "control/motion/state_layout.hpp"
#include "control/queue/lane_lists.hpp"
#include "control/receiving/chunk_rows.hpp"
#include "control/receiving/ledger.hpp"
#include "control/receiving/pool.hpp"

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
  void drop(const Outcome& outcome, Iteration iteration) noexcept;
  /// Ends the commands of one lane, and releases a direct value that this lane has set.
  void drop_lane(std::uint32_t lane, const Outcome& outcome, Iteration iteration) noexcept {
    if (is_of(lane)) {
      if (runs_ == Runs::alone) ledger_->drop(record_, outcome, iteration);
      end_motion();
    }
    if (holder_ == lane) motion_.hold(false);
    close_plan(lane, kEveryPlan);
    ledger_->drop(queue_.take(lane), outcome, iteration);
    if (empty()) end_motion();
  }
  /// For commands of several actuators (src/control/README.md#queue); called for all queues before
  /// any step(). Reports that the next command is a member of a group.
  void arrive(Iteration iteration, std::uint32_t& late_budget) noexcept {
    if (runs_ == Runs::queued || !end_late(iteration, late_budget)) return;
    const RecordHead* head = next_member();
    // a running set-point counts as having reached a direct command
    if (head == nullptr || (runs_ != Runs::nothing && !gives_way_to(*head))) return;
    ledger_->groups().arrive(*head, iteration);
    // all members use the largest rounding carry
    if (head->pace == Pace::duration) {
      ledger_->groups().offer(*head, CommandGroups::Offer::carry, iteration, carry_.carried());
    }
  }
  /// Then: the group that begins in this iteration while the actuator has no motion, or kNoBlock.
  BlockIndex beginning_group(Iteration iteration) noexcept {
    const RecordHead* head = runs_ == Runs::nothing ? next_member() : nullptr;
    return head && may_begin(*head, iteration) ? CommandGroups::head_of(*head) : kNoBlock;
  }
  /// Then, if all members have arrived: takes the largest carry of durations.
  void agree_on_carry(Iteration iteration) noexcept {
    const RecordHead* head = next_member();
    if (runs_ != Runs::nothing || head == nullptr || head->pace != Pace::duration) return;
    if (may_begin(*head, iteration)) carry_.carry(ledger_->groups().agreed(*head));
  }
  /// Then, if all members have arrived: proposes its number of iterations. The largest is used.
  void plan_with_others(Iteration iteration, const std::byte* observed) noexcept;
  /// `late_budget`: number of late commands that may still be rejected in this iteration.
  Moved step(Iteration iteration, const std::byte* observed, std::uint32_t& late_budget) noexcept {
    motion_.observe(observed);
    // mostly the row of a command goes on
    const bool continues = runs_ == Runs::queued && !needs_row(iteration);
    return continues || begin(iteration, observed, late_budget) ? advance(iteration)
                                                                : come_to_rest(observed);
  }
  /// It has moved, or had a command, in this iteration.
  void acted(Iteration iteration) noexcept { acted_last_ = iteration; }
  Iteration acted_last() const noexcept { return acted_last_; }
  /// The chunk that was taken last, to know older ones.
  struct LastChunk {
    std::uint32_t lane = 0;
    std::uint64_t plan = 0;
    Iteration anchor = kNone;
    static constexpr Iteration kNone = -(Iteration{1} << 62);
  };
  LastChunk last_chunk;
  /// A chunk of this plan begins in this iteration.
  void open_plan(std::uint32_t lane, const ChunkHead& chunk) noexcept {
    open_plan_ = {lane, chunk.final == 0, chunk.plan};
  }
  /// Iterations that limits need for the take-over to a row of this chunk, due in `iterations`.
  double to_take_over(BlockIndex member, std::uint32_t row, std::int64_t iterations) noexcept;
  /// From where its numbers take over; returns how many. `to` has room for the whole state.
  std::size_t put_starts(BlockIndex member, std::span<ChunkStart> to) noexcept;
  static constexpr std::uint64_t kEveryPlan = 0;
  /// No chunk of this plan of a lane follows.
  void close_plan(std::uint32_t lane, std::uint64_t plan) noexcept {
    const bool is_meant =
        open_plan_.lane == lane && (plan == kEveryPlan || plan == open_plan_.plan);
    if (is_meant) open_plan_.is_open = false;
  }
  /// True if a plan of chunks is open and has no row left, and nothing else acts.
  bool starved() const noexcept { return open_plan_.is_open && empty(); }
  /// True if no command or given target is running or queued.
  bool empty() const noexcept { return has_no_command() && runs_ == Runs::nothing; }
  bool has_no_command() const noexcept { return queue_.empty() && !has_record(); }
  /// How far the last step was from the plan, if a limit changed it.
  float off_plan() const noexcept { return static_cast<float>(motion_.off_plan()); }
  /// For targets that are given without a command, to a queue that has none: begins a row of them.
  void begin_given(Mode mode) noexcept {
    if (mode == Mode::overwrite) carry_.reset();
    open_plan_.is_open = false;
    motion_.hold(false);
  }
  /// Then, in each iteration: goes to the next one, like a direct command. The last stays in force.
  Moved go_to(Iteration iteration, const std::byte* observed, const std::byte* target) noexcept;
  /// True if a direct value keeps a number away from its rest value.
  bool holds() const noexcept { return motion_.holds(); }
  /// True if an iteration without a command would change nothing.
  bool at_rest() const noexcept { return motion_.at_rest(follows()); }
  /// True without a command, if the next one depends on nothing but the desired state.
  bool shows_all() noexcept {
    return empty() && !holds() && motion_.is_published(desired_) &&
           (!in_force_ || layout_->same(desired_, motion_.target(), mask()));
  }
  /// True if nothing moves.
  bool rests() const noexcept { return follows() ? at_rest() : motion_.rests(); }
  /// True if a command of this lane is queued or running, its direct value is still held, or its
  /// plan of chunks is open.
  bool acts(std::uint32_t lane) const noexcept {
    return queue_.has(lane) || is_of(lane) || (holder_ == lane && holds()) ||
           (open_plan_.is_open && open_plan_.lane == lane);
  }

  /// Sets the desired state, at rest. Numbers that are not finite keep their last desired value.
  /// `follows`: until the next restart it follows when idle, whatever its when_idle.
  void restart(const std::byte* state, bool follows = false) noexcept {
    follows_now_ = follows;
    layout_->copy_finite(desired_, state);
    motion_.restart(desired_);
    in_force_ = false;
  }
  /// One more iteration, after restart(), of a motion that was made elsewhere.
  void trace(const std::byte* state) noexcept {
    layout_->copy_finite(desired_, state);
    motion_.trace(desired_);
  }
  /// What comes next begins where it is observed. Numbers with a rest value stay.
  void begin_at(const std::byte* observed) noexcept {
    layout_->copy_finite(desired_, observed);
    in_force_ = false;
    motion_.follow(desired_);
  }
  /// For an idle actuator that follows: numbers without a rest value become the observed ones, the
  /// others go to it. True while one of these moves.
  bool follow(const std::byte* observed) noexcept {
    begin_at(observed);
    return motion_.brake(desired_, true);
  }
  const StateLayout& layout() const noexcept { return *layout_; }
  bool follows() const noexcept { return when_idle_ == WhenIdle::follow || follows_now_; }
  /// As Motion::difference().
  double difference(std::uint32_t offset, std::uint32_t order) const noexcept {
    return motion_.difference(offset, order);
  }

 private:
  // waypoints of a trajectory that are read ahead in one iteration, for its span. A motion that
  // speeds up and stops in i iterations each needs the span of i waypoints in iteration i.
  static constexpr std::uint32_t kReadAhead = 16;

  /// What moves the actuator.
  enum class Runs : std::uint8_t {
    nothing,
    queued,  // the command at the front of the queue
    alone,   // a command that may give way to its successor: taken out of the queue
    given    // a given target, without a record
  };
  /// A direct command or a given target, besides its mask and target: an equal one changes nothing.
  struct SetPoint {
    Profile profile = Profile::linear;
    Start start = Start::desired;
    std::int64_t every = 0;  // [ns]
    bool operator==(const SetPoint&) const = default;
  };

  /// The rest of the own times of rows.
  struct RowTimes {
    Cursor ends;
    std::int64_t time = 0;  // end time of the last row [ns]

    /// `left`: rows that are left; read() reads one of them.
    template <class Read>
    std::int64_t next(DurationCarry& carry, const std::uint32_t& left, Read&& read) noexcept;
  };

  bool has_record() const noexcept { return runs_ == Runs::queued || runs_ == Runs::alone; }
  bool is_of(std::uint32_t lane) const noexcept {
    return has_record() && ledger_->lane_of(record_) == lane;
  }
  bool may_give_way() const noexcept { return runs_ == Runs::alone || runs_ == Runs::given; }
  /// A set-point gives way to a direct command, a trajectory whose rows have ended to any command.
  bool gives_way_to(const RecordHead& next) const noexcept {
    return pace_ != Pace::direct || next.pace == Pace::direct;
  }
  bool may_begin(const RecordHead& next, Iteration iteration) noexcept {
    return !is_member(next) || ledger_->groups().is_complete(next, iteration);
  }
  /// The next command of the queue, if it is a member of a group.
  const RecordHead* next_member() const noexcept {
    const RecordHead* head = queue_.empty() ? nullptr : &pool_->head(queue_.front());
    return head != nullptr && is_member(*head) ? head : nullptr;
  }
  bool begin(Iteration iteration, const std::byte* observed, std::uint32_t& late_budget) noexcept;
  bool needs_row(Iteration iteration) const noexcept {
    const bool row_is_over = pace_ == Pace::direct || iteration > motion_.last();
    return planned_ || (row_is_over && rows_left_ > 0);
  }
  bool end_late(Iteration iteration, std::uint32_t& late_budget) noexcept;
  void give_way(Iteration iteration) noexcept {
    if (iteration > motion_.last() + 1) carry_.reset();  // begins late: its time counts anew
    end(leave(), {Status::overwritten}, iteration);
  }
  void begin_command(const std::byte* observed) noexcept;
  const std::uint64_t* mask_of(BlockIndex record) noexcept;
  void begin_chunk() noexcept;
  void switch_passed_rows(Iteration iteration) noexcept;
  /// `together`: the next one is that of a group, so it may take as long as the last one did.
  bool is_in_force(const SetPoint& next, bool together = false) const noexcept {
    return in_force_ && !motion_.was_held_back() && next == set_point_ &&
           (together || !is_stretched_);
  }
  /// True if the next row is the target already.
  bool is_next_row_target() noexcept {
    Cursor next = rows_;
    next.read(scratch(), layout_->size());
    return layout_->same(scratch(), motion_.target(), mask());
  }
  bool begin_row(Iteration iteration) noexcept;
  void plan_row(Iteration iteration) noexcept;
  /// The next row of the command => target.
  void read_row() noexcept {
    rows_.read(masked_ ? scratch() : motion_.target(), layout_->size());
    if (masked_) {
      layout_->copy(motion_.target(), desired_);
      layout_->copy(motion_.target(), scratch(), mask_.data());
    }
    --rows_left_;
  }
  Motion::Course course(const RecordHead& head, Iteration iteration) noexcept;
  void look_ahead(Motion::Course& course, const RecordHead& head) noexcept;
  void to_next_row(Motion::Course& course, Iteration iteration) noexcept;
  /// The chunk that runs.
  const ChunkHead& chunk() const noexcept {
    return chunk_of(*pool_, CommandGroups::head_of(pool_->head(record_)));
  }
  Moved advance(Iteration iteration) noexcept;
  /// Without a command the motion brakes within its limits, and fields with a rest value go to it.
  Moved come_to_rest(const std::byte* observed) noexcept {
    motion_.end();
    carry_.reset();
    const bool moves = follows() ? follow(observed) : motion_.brake(desired_, false);
    return moves ? Moved::braking : Moved::idle;
  }
  /// Nothing runs any more; the record of what ran, if it has one.
  BlockIndex leave() noexcept {
    if (runs_ == Runs::queued) queue_.pop();
    return std::exchange(runs_, Runs::nothing) == Runs::given ? kNoBlock : record_;
  }
  void end_running(Iteration iteration) noexcept;
  void end(BlockIndex record, const Outcome& outcome, Iteration iteration) noexcept {
    if (record != kNoBlock) ledger_->end(record, outcome, iteration);
  }
  /// The running command leaves the queue; it ends when it has arrived, or gives way to the next.
  void take_out() noexcept {
    queue_.pop();
    pool_->head(record_).own[Own::kNext] = kNoBlock;
    runs_ = Runs::alone;
  }
  void stop() noexcept {
    carry_.reset();
    runs_ = Runs::nothing;
    planned_ = in_force_ = false;
  }
  void end_motion() noexcept {
    motion_.end();
    stop();
  }
  const std::uint64_t* mask() const noexcept { return masked_ ? mask_.data() : nullptr; }
  std::byte* scratch() noexcept { return reinterpret_cast<std::byte*>(scratch_.data()); }

  const StateLayout* layout_;
  BlockPool* pool_;
  Ledger* ledger_;
  std::byte* desired_;
  Motion motion_;
  DurationCarry carry_;
  double period_;  // [s]
  Profile usual_profile_;
  WhenIdle when_idle_;
  bool follows_now_ = false;

  LaneLists queue_;
  Runs runs_ = Runs::nothing;
  BlockIndex record_ = kNoBlock;  // the running command
  std::uint32_t holder_ = 0;      // lane that gave the direct value that stays
  /// The plan of the chunk that began last.
  struct OpenPlan {
    std::uint32_t lane = 0;
    bool is_open = false;  // that chunk was not its last one, and nothing has ended or replaced it
    std::uint64_t plan = 0;
  };
  OpenPlan open_plan_;

  // the set-point in force: of the running command, or of the last one if nothing came after it
  bool in_force_ = false;
  SetPoint set_point_;
  bool is_stretched_ = false;  // its group takes longer than this actuator needs

  // the running command
  Pace pace_ = Pace::direct;
  std::uint32_t rows_left_ = 0;
  bool masked_ = false;
  bool keeps_plan_ = false;          // a set-point equal to the one in force
  bool begun_ = false;               // reported as active
  bool planned_ = false;             // plan_with_others() has planned its next waypoint
  std::int64_t row_iterations_ = 1;  // iterations of the planned waypoint
  std::int64_t requested_ = 0;       // of these, those that were asked for; 0: none
  std::int64_t late_ = 0;            // iterations more than requested
  Limited reason_;                   // for these
  RowTimes times_;
  Cursor rows_;
  // of a chunk: the next row, and while it takes over the row that numbers that switch are at
  std::uint32_t row_ = 0;
  std::uint32_t switch_row_ = 0;
  Cursor ahead_;  // next row of a trajectory whose span is not known yet
  std::uint32_t ahead_left_ = 0;
  std::vector<std::uint64_t> mask_;
  std::vector<std::uint64_t> next_mask_;
  std::vector<std::uint64_t> scratch_;  // space for three states
  Iteration acted_last_ = -1;
};

}  // namespace o80
