#include "control/queue/actuator_queue.hpp"

#include <algorithm>
#include <cmath>

#include "control/batch/command_check.hpp"
#include "control/receiving/record_check.hpp"

namespace o80 {
namespace {

// most waypoints of a trajectory that are skipped in one iteration, because they end before it
constexpr int kMaxPassed = 256;

}  // namespace

ActuatorQueue::ActuatorQueue(const Schema& schema, const ActuatorRow& row,
                             const StateLayout& layout, BlockPool& pool, Ledger& ledger,
                             std::byte* desired, std::uint32_t lanes)
    : layout_(&layout),
      pool_(&pool),
      ledger_(&ledger),
      desired_(desired),
      motion_(schema, row, layout),
      carry_(schema.head.period),
      period_(static_cast<double>(schema.head.period) / 1e9),
      usual_profile_(usual_profile(schema, row)),
      when_idle_(row.when_idle),
      queue_(pool, lanes),
      mask_(layout.mask_words()),
      next_mask_(mask_.size()),
      scratch_(3 * ((layout.size() + 7) / 8)) {}

void ActuatorQueue::drop(const Outcome& outcome, Iteration iteration) noexcept {
  const bool is_overwritten = outcome.status == Status::overwritten;
  const bool in_force = in_force_ && is_overwritten;
  if (runs_ == Runs::alone) ledger_->drop(record_, outcome, iteration);
  // the motion of an overwritten command goes on until its successor begins
  if (!is_overwritten) motion_.end();
  stop();
  open_plan_.is_open = false;
  in_force_ = in_force;
  motion_.hold(false);
  while (!queue_.empty()) ledger_->drop(queue_.take_any(), outcome, iteration);
}

/// Begins what runs in this iteration: a row, or a command; false if there is none.
bool ActuatorQueue::begin(Iteration iteration, const std::byte* observed,
                          std::uint32_t& late_budget) noexcept {
  if (!planned_ && may_give_way() && end_late(iteration, late_budget)) {
    const RecordHead& next = pool_->head(queue_.front());
    if (may_begin(next, iteration) && gives_way_to(next)) give_way(iteration);
  }
  if (runs_ != Runs::nothing && (!needs_row(iteration) || begin_row(iteration))) return true;
  while (end_late(iteration, late_budget)) {
    const RecordHead& head = pool_->head(queue_.front());
    // while it waits for the others of a group it brakes
    if (!may_begin(head, iteration)) return false;
    begin_command(observed);
    if (begin_row(iteration)) return true;
    if (late_budget == 0) return false;
    --late_budget;
  }
  return false;
}

/// One iteration of what runs, which may be its last.
ActuatorQueue::Moved ActuatorQueue::advance(Iteration iteration) noexcept {
  // rows of a trajectory widen the span in which the limiter follows it
  for (std::uint32_t i = 0; i < kReadAhead && ahead_left_ > 0; ++i, --ahead_left_) {
    ahead_.read(scratch(), layout_->size());
    motion_.widen(scratch());
  }
  if (pace_ == Pace::chunk && switch_row_ < row_) switch_passed_rows(iteration);
  const Limited limited = motion_.step(iteration, desired_);
  if (limited.limit != Limit::none && late_ == 0) reason_ = limited;
  if (iteration >= motion_.last() && rows_left_ == 0) {
    if (motion_.is_blocked()) {
      // bounds of an integral hold it back: it ends where it is
      const BlockIndex record = leave();
      end_motion();
      open_plan_.is_open = false;
      end(record, {Status::interrupted, Reason::limits, limited.packed()}, iteration);
    } else if (motion_.arrived()) {
      end_running(iteration);
    } else if (runs_ == Runs::queued &&
               (pool_->head(record_).rows > 1 || plays_rows(pool_->head(record_)))) {
      take_out();
    }
  }
  return limited.limit == Limit::none ? Moved::active : Moved::clamped;
}

ActuatorQueue::Moved ActuatorQueue::go_to(Iteration iteration, const std::byte* observed,
                                          const std::byte* target) noexcept {
  motion_.observe(observed);
  const SetPoint set_point{usual_profile_};
  if (masked_ || !is_in_force(set_point) || !layout_->same(target, motion_.target(), nullptr)) {
    motion_.begin(nullptr);
    layout_->copy(motion_.target(), target);
    Motion::Course course;
    course.profile = usual_profile_;
    motion_.settle(iteration, motion_.propose(course, desired_));
  }
  set_point_ = set_point;
  pace_ = Pace::direct;
  masked_ = planned_ = is_stretched_ = false;
  rows_left_ = ahead_left_ = 0;
  in_force_ = true;
  runs_ = Runs::given;
  return advance(iteration);
}

void ActuatorQueue::end_running(Iteration iteration) noexcept {
  in_force_ = pace_ == Pace::direct;
  if (in_force_) motion_.hold(true);
  late_ += iteration - motion_.last();
  motion_.end(true);
  const BlockIndex record = leave();
  if (record == kNoBlock) return;
  if (late_ > 0) carry_.reset();
  holder_ = ledger_->lane_of(record);
  Outcome outcome;
  if (late_ > 0 && requested_ > 0)
    outcome = {outcome.status, Reason::limits, reason_.packed(), late_};
  ledger_->end(record, outcome, iteration);
}

/// Rejects commands whose `until` has passed; false if no command is left to begin.
bool ActuatorQueue::end_late(Iteration iteration, std::uint32_t& late_budget) noexcept {
  while (!queue_.empty()) {
    const BlockIndex record = queue_.front();
    const RecordHead& late = pool_->head(record);
    if (late.pace != Pace::until || late.amount >= iteration) return true;
    if (late_budget == 0) return false;
    --late_budget;
    carry_.reset();
    queue_.pop();
    ledger_->end(record, {Status::rejected, Reason::late}, iteration);
  }
  return false;
}

void ActuatorQueue::begin_command(const std::byte* observed) noexcept {
  // head => mask, times, rows
  record_ = queue_.front();
  const RecordHead& head = pool_->head(record_);
  rows_ = Cursor(*pool_, record_, sizeof(RecordHead), head.payload_bytes);
  bool same_mask = std::exchange(masked_, head.masked != 0) == (head.masked != 0);
  if (masked_) {
    rows_.read(next_mask_.data(), next_mask_.size() * sizeof next_mask_.front());
    same_mask = same_mask && mask_ == next_mask_;
    mask_.swap(next_mask_);
  }
  if (is_chunk(head)) return begin_chunk();
  open_plan_.is_open = false;
  const SetPoint next{head.profile, head.start, head.amount};
  const bool together = is_member(head) && head.rows == 1;
  keeps_plan_ =
      same_mask && head.pace == Pace::direct && is_in_force(next, together) && is_next_row_target();
  // targets of a generator are one motion
  const bool streams = same_mask && in_force_ && set_point_.profile == Profile::as_sent &&
                       head.profile == Profile::as_sent;
  if (is_timed(head)) {
    // the check has stored the position of the rows
    times_ = {rows_};
    rows_ = rows_of_timed(*pool_, head, layout_->size());
  }
  pace_ = head.pace;
  rows_left_ = head.rows;
  ahead_ = rows_;
  ahead_left_ = 0;
  runs_ = Runs::queued;
  begun_ = false;
  late_ = 0;
  reason_ = {};
  in_force_ = pace_ == Pace::direct;
  set_point_ = next;
  motion_.hold(false);
  if (keeps_plan_ || streams) return;
  // straight lines begin at the actuator, curves at the plan of the rows before them
  const bool is_curve = plays_rows(head) && head.profile != Profile::linear;
  is_curve ? motion_.take_over(mask()) : motion_.begin(mask());
  if (head.start == Start::observed) motion_.start_at(observed);
}

void ActuatorQueue::begin_chunk() noexcept {
  const RecordHead& head = pool_->head(record_);
  const ChunkRows rows(*pool_, record_, *layout_);
  row_ = chunk().row;
  rows_ = rows.cursor(row_);
  pace_ = head.pace;
  rows_left_ = head.rows - row_;
  ahead_left_ = 0;
  runs_ = Runs::queued;
  begun_ = keeps_plan_ = in_force_ = false;
  late_ = 0;
  reason_ = {};
  motion_.hold(false);
  motion_.take_over(mask());
  rows.ranges_from(row_, scratch(),
                   [&](std::uint32_t number, const Span& range) { motion_.widen(number, range); });
  switch_row_ = motion_.has_switches() ? chunk().late : row_;
}

double ActuatorQueue::to_take_over(BlockIndex member, std::uint32_t row,
                                   std::int64_t iterations) noexcept {
  ChunkRows(*pool_, member, *layout_).cursor(row).read(scratch(), layout_->size());
  double most = 0.0;
  motion_.each_moment(
      mask_of(member), [&](std::uint32_t i, const Moment& from, const Rates& rates) {
        most = std::max(most, iterations_to_take_over(from, layout_->number(i, scratch()),
                                                      static_cast<double>(iterations), rates));
      });
  return most;
}

std::size_t ActuatorQueue::put_starts(BlockIndex member, std::span<ChunkStart> to) noexcept {
  std::size_t count = 0;
  motion_.each_moment(mask_of(member), [&](std::uint32_t i, const Moment& from, const Rates&) {
    to[count++] = {pool_->head(member).actuator, i, from.position, from.speed, from.acceleration};
  });
  return count;
}

/// The numbers that a command gives, in next_mask_; null: all.
const std::uint64_t* ActuatorQueue::mask_of(BlockIndex record) noexcept {
  const RecordHead& head = pool_->head(record);
  if (head.masked == 0) return nullptr;
  Cursor(*pool_, record, sizeof(RecordHead), head.payload_bytes)
      .read(next_mask_.data(), next_mask_.size() * sizeof next_mask_.front());
  return next_mask_.data();
}

/// Numbers that switch do not wait for the end of a take-over.
void ActuatorQueue::switch_passed_rows(Iteration iteration) noexcept {
  const ChunkRows rows(*pool_, record_, *layout_);
  const std::int64_t passed = iteration - chunk().anchor - chunk().shift;
  while (switch_row_ < chunk().row && rows.due(switch_row_) < passed) ++switch_row_;
  if (switch_row_ > chunk().row) return;
  rows.cursor(switch_row_).read(scratch(), layout_->size());
  motion_.switch_to(scratch(), mask());
  if (switch_row_ == chunk().row) ++switch_row_;
}

void ActuatorQueue::plan_with_others(Iteration iteration, const std::byte* observed) noexcept {
  const RecordHead* head = next_member();
  // set-points of each iteration go each by itself
  if (head == nullptr || (head->pace == Pace::direct && head->rows > 1) || is_chunk(*head)) return;
  if (runs_ == Runs::queued) {
    if (iteration <= motion_.last() || rows_left_ == 0) return;
  } else {
    if (runs_ != Runs::nothing && !gives_way_to(*head)) return;
    if (!may_begin(*head, iteration)) return;
    if (runs_ != Runs::nothing) give_way(iteration);
    begin_command(observed);
  }
  plan_row(iteration);
  ledger_->groups().offer(*head, CommandGroups::Offer::iterations, iteration, row_iterations_);
  planned_ = true;
}

/// Begins the planned row; false if the command would take too long and is rejected.
bool ActuatorQueue::begin_row(Iteration iteration) noexcept {
  const RecordHead& head = pool_->head(record_);
  const bool together = std::exchange(planned_, false);
  if (!together) plan_row(iteration);
  const std::int64_t own = row_iterations_;
  if (together) row_iterations_ = ledger_->groups().agreed(head);
  is_stretched_ = (keeps_plan_ && is_stretched_) || row_iterations_ > own;
  const bool is_requested = pace_ != Pace::speed && row_iterations_ <= requested_;
  if (row_iterations_ > kLongestPlan && !is_requested) {
    queue_.pop();
    end_motion();
    ledger_->end(record_, {Status::rejected, Reason::invalid, Limited{Limit::speed, 0}.packed()},
                 iteration);
    return false;
  }
  if (keeps_plan_) {
    motion_.extend(iteration + row_iterations_ - 1);
  } else if (pace_ == Pace::direct && set_point_.profile == Profile::as_sent) {
    motion_.follow_as_sent(iteration);
  } else {
    motion_.settle(iteration, row_iterations_);
  }
  if (requested_ > 0 && row_iterations_ > requested_) {
    if (late_ == 0) reason_ = motion_.slowest();
    late_ += row_iterations_ - requested_;
    carry_.reset();
  }
  if (!std::exchange(begun_, true)) {
    Outcome outcome{Status::active};
    if (late_ > 0) outcome = {Status::active, Reason::limits, reason_.packed(), late_};
    ledger_->activate(record_, iteration, outcome);
    // of a chunk the span is known
    if (head.rows > 1 && pace_ != Pace::chunk && motion_.follows_rows()) ahead_left_ = head.rows;
  }
  if (pace_ == Pace::direct && rows_left_ == 0) take_out();
  return true;
}

/// Reads the next waypoint: its target and number of iterations.
void ActuatorQueue::plan_row(Iteration iteration) noexcept {
  if (begun_ && pace_ == Pace::direct) {
    // a set-point of a row of them: it replaces the one before, or is equal to it
    keeps_plan_ = is_next_row_target();
    if (!keeps_plan_) motion_.begin(mask());
  } else if (begun_) {
    motion_.next_row();
  }
  if (keeps_plan_) {
    rows_.read(scratch(), layout_->size());
    --rows_left_;
    requested_ = 0;
    row_iterations_ = std::max<std::int64_t>(1, motion_.last() - iteration + 1);
    return;
  }
  read_row();
  const RecordHead& head = pool_->head(record_);
  const Motion::Course next = course(head, iteration);
  const bool is_as_sent = head.profile == Profile::as_sent;
  row_iterations_ = is_as_sent ? 1 : motion_.propose(next, desired_);
  requested_ = next.iterations;
  // of several actuators, others may be slower
  if (head.pace == Pace::speed && !is_member(head)) requested_ = motion_.requested_by_speed();
}

Motion::Course ActuatorQueue::course(const RecordHead& head, Iteration iteration) noexcept {
  Motion::Course next;
  next.profile = head.profile;
  next.first = layout_->first_commanded(mask());
  next.is_row = plays_rows(head);
  switch (head.pace) {
    case Pace::direct:
      if (head.amount > 0 && motion_.accelerates()) {
        next.iterations = std::max<std::int64_t>(
            1, std::llround(2e-9 * static_cast<double>(head.amount) / period_));
      }
      break;
    case Pace::fastest:
      next.profile = Profile::linear;
      break;
    case Pace::iterations:
      next.iterations = std::max<std::int64_t>(1, head.amount);
      break;
    case Pace::until:
      carry_.reset();
      next.iterations = head.amount - iteration + 1;
      break;
    case Pace::speed:
      next.cruise = head.speed * period_;
      break;
    case Pace::chunk:
      to_next_row(next, iteration);
      break;
    case Pace::duration:
      next.iterations = is_timed(head) ? times_.next(carry_, rows_left_, [this] { read_row(); })
                                       : carry_.iterations(head.amount);
      break;
  }
  next.is_first = !begun_;
  const bool is_curve = next.is_row && is_curved(head.profile);
  if (is_curve && rows_left_ > 0) look_ahead(next, head);
  return next;
}

/// The way to the row of a chunk that was read last.
void ActuatorQueue::to_next_row(Motion::Course& course, Iteration iteration) noexcept {
  const ChunkHead& of = chunk();
  const ChunkRows rows(*pool_, record_, *layout_);
  const std::uint32_t row = row_++;
  Iteration due = of.anchor + of.shift + rows.due(row);
  // the last row, if it would be due before the end of the take-over
  if (row == of.row && course.profile != Profile::hold) {
    due = std::max<Iteration>(due, iteration + of.ease - 1);
  }
  course.iterations = std::max<std::int64_t>(1, due - iteration + 1);
  if (rows_left_ > 0) course.next_iterations = rows.due(row + 1) - rows.due(row);
}

/// Reads the rows after the next one, for the curve to it.
void ActuatorQueue::look_ahead(Motion::Course& course, const RecordHead& head) noexcept {
  const std::size_t size = scratch_.size() / 3 * sizeof scratch_.front();
  Cursor rows = rows_;
  std::uint32_t left = rows_left_;
  const auto read = [&](std::byte* row) {
    rows.read(row, layout_->size());
    --left;
    return row;
  };
  course.next = read(scratch() + size);
  if (head.pace == Pace::iterations) course.next_iterations = course.iterations;
  if (is_timed(head)) {
    RowTimes times = times_;
    DurationCarry carry = carry_;
    course.next_iterations = times.next(carry, left, [&] { read(scratch() + size); });
  }
  if (course.is_first && left > 0) course.after = read(scratch() + 2 * size);
}

/// Skips rows that end before the next iteration; the iterations of the first that does not.
template <class Read>
std::int64_t ActuatorQueue::RowTimes::next(DurationCarry& carry, const std::uint32_t& left,
                                           Read&& read) noexcept {
  const auto duration = [&] {
    std::int64_t end = time;
    ends.read(&end, sizeof end);
    return end - std::exchange(time, end);
  };
  std::int64_t next = duration();
  for (int i = 0; i < kMaxPassed && left > 0 && carry.pass(next); ++i) {
    read();
    next = duration();
  }
  return carry.iterations(next);
}

}  // namespace o80
