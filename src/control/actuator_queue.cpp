#include "control/actuator_queue.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "control/record_check.hpp"

namespace o80 {
namespace {

constexpr double kNoSpeed = std::numeric_limits<double>::infinity();
// most waypoints of a trajectory that are skipped in one iteration, because they end before it
constexpr int kMostPassed = 256;
// most waypoints of an overwritten trajectory that are read
constexpr std::uint32_t kMostAhead = 64;

}  // namespace

ActuatorQueue::ActuatorQueue(const Schema& schema, const ActuatorRow& row,
                             const StateLayout& layout, BlockPool& pool, Ledger& ledger,
                             std::byte* desired, std::uint32_t lanes)
    : layout_(&layout),
      pool_(&pool),
      ledger_(&ledger),
      desired_(desired),
      motion_(layout),
      limiter_(schema, row, layout),
      carry_(schema.head.period),
      period_(static_cast<double>(schema.head.period) / 1e9),
      when_idle_(row.when_idle),
      queue_(pool, lanes),
      mask_(mask_words(static_cast<std::uint32_t>(layout.numbers().size()))),
      scratch_((layout.size() + 7) / 8),
      spare_((layout.size() + 7) / 8) {}

void ActuatorQueue::drop(Status status, Reason reason, Iteration iteration) noexcept {
  if (status != Status::overwritten) {
    end_motion();
  } else if (running_) {
    keep_moving();
    limiter_.keep_lagging(motion_, desired_);
  }
  carry_.reset();
  running_ = false;
  limiter_.release();
  while (!queue_.empty()) ledger_->drop(queue_.take_any(), status, reason, iteration);
}

/// Stores the running motion for the command that overwrites it. The overwritten velocity fades
/// within the span of the further waypoints of the trajectory.
void ActuatorQueue::keep_moving() noexcept {
  auto* ahead = reinterpret_cast<std::byte*>(scratch_.data());
  layout_->copy(ahead, motion_.to());
  const std::uint32_t rows = std::min(rows_left_, kMostAhead);
  Cursor cursor = rows_;
  auto* row = reinterpret_cast<std::byte*>(spare_.data());
  for (std::uint32_t i = 0; i < rows; ++i) cursor.read(row, layout_->size());
  if (rows > 0) layout_->copy(ahead, row, mask());
  motion_.keep_moving(ahead, rows);
}

void ActuatorQueue::end_motion() noexcept {
  motion_.rest();
  carry_.reset();
  running_ = false;
}

void ActuatorQueue::drop_lane(std::uint32_t lane, Status status, Reason reason,
                              Iteration iteration) noexcept {
  if (running_ && queue_.front_lane() == lane) end_motion();
  if (holder_ == lane) limiter_.release();
  ledger_->drop(queue_.take(lane), status, reason, iteration);
  if (queue_.empty()) end_motion();
}

void ActuatorQueue::restart(const std::byte* state) noexcept {
  layout_->copy_finite(desired_, state);
  limiter_.restart(desired_);
  streams_ = false;
}

bool ActuatorQueue::follow(const std::byte* observed) noexcept {
  layout_->copy_finite(desired_, observed);
  return limiter_.brake_resting(desired_);
}

ActuatorQueue::Moved ActuatorQueue::step(Iteration iteration, const std::byte* observed,
                                         std::uint32_t& late_budget) noexcept {
  if (running_) {
    if (planned_ || iteration > motion_.last()) begin_row(iteration, observed);
  } else if (!begin_next(iteration, observed, late_budget)) {
    return come_to_rest(observed);
  }
  limited_ = move(iteration);
  if (iteration >= motion_.last() && rows_left_ == 0) end_running(iteration);
  return limited_.limit == Limit::none ? Moved::active : Moved::clamped;
}

void ActuatorQueue::begin_given(Mode mode) noexcept {
  if (mode == Mode::overwrite) carry_.reset();
  motion_.rest();
  limiter_.release();
  limiter_.begin();
  streams_ = false;
}

ActuatorQueue::Moved ActuatorQueue::go_to(const std::byte* target) noexcept {
  layout_->copy(desired_, target);
  return limiter_.follow(desired_).limit == Limit::none ? Moved::active : Moved::clamped;
}

Limited ActuatorQueue::move(Iteration iteration) noexcept {
  motion_.state(iteration, desired_);
  if (!limiter_.any()) return {};
  if (pace_ == Pace::fastest) return limiter_.follow_fastest(desired_);
  return limiter_.follow(motion_, desired_, mask(), first_number_, most_);
}

void ActuatorQueue::end_running(Iteration iteration) noexcept {
  const BlockIndex record = queue_.front();
  streams_ = pace_ == Pace::direct;
  if (streams_) limiter_.hold(mask());
  holder_ = queue_.front_lane();
  running_ = false;
  queue_.pop();
  if (limited_.limit == Limit::none) {
    ledger_->end(record, Status::completed, Reason::none, 0, iteration);
  } else {
    ledger_->end(record, Status::limited, Reason::limits, limited_.packed(), iteration);
  }
}

/// Without a command: the motion brakes within its limits, and fields with a rest value go to it.
ActuatorQueue::Moved ActuatorQueue::come_to_rest(const std::byte* observed) noexcept {
  streams_ = false;
  if (empty()) end_motion();
  const bool moves = follows() ? follow(observed) : limiter_.any() && limiter_.brake(desired_);
  return moves ? Moved::braking : Moved::idle;
}

bool ActuatorQueue::begin_next(Iteration iteration, const std::byte* observed,
                               std::uint32_t& late_budget) noexcept {
  if (!end_late(iteration, late_budget)) return false;
  const RecordHead& head = pool_->head(queue_.front());
  if (is_member(head) && !ledger_->groups().is_complete(head, iteration)) {
    end_motion();  // it brakes while it waits, so the group command starts from rest
    return false;
  }
  begin_command(iteration);
  begin_row(iteration, observed);
  return true;
}

/// Rejects commands whose `until` has passed; false if no command is left to begin.
bool ActuatorQueue::end_late(Iteration iteration, std::uint32_t& late_budget) noexcept {
  while (!queue_.empty()) {
    const RecordHead& late = pool_->head(queue_.front());
    if (late.pace != Pace::until || late.amount >= iteration) break;
    if (late_budget == 0) return false;
    --late_budget;
    carry_.reset();
    const BlockIndex record = queue_.front();
    queue_.pop();
    ledger_->end(record, Status::rejected, Reason::late, 0, iteration);
  }
  return !queue_.empty();
}

void ActuatorQueue::begin_command(Iteration iteration) noexcept {
  // head => mask, times, rows
  const BlockIndex record = queue_.front();
  const RecordHead& head = pool_->head(record);
  rows_ = Cursor(*pool_, record, sizeof(RecordHead), head.payload_bytes);
  masked_ = head.masked != 0;
  if (masked_) rows_.read(mask_.data(), mask_.size() * sizeof mask_.front());
  timed_ = head.pace == Pace::duration && head.rows > 1;
  time_ = 0;
  if (timed_) {
    // the check has stored the position of the rows
    times_ = rows_;
    rows_ = rows_of_timed(*pool_, head, layout_->size());
  }
  limiter_.release();
  pace_ = head.pace;
  first_number_ = layout_->first_commanded(mask());
  most_ = pace_ == Pace::speed ? head.speed * period_ : kNoSpeed;
  rows_left_ = head.rows;
  first_row_ = true;
  running_ = true;
  // consecutive direct commands are one motion
  if (pace_ != Pace::direct || !streams_) limiter_.begin();
  streams_ = false;
  if (is_member(head) && pace_ == Pace::duration) carry_.carry(ledger_->groups().agreed(head));
  ledger_->activate(record, iteration);
}

void ActuatorQueue::arrive(Iteration iteration, std::uint32_t& late_budget) noexcept {
  if (running_ || !end_late(iteration, late_budget)) return;
  const RecordHead& head = pool_->head(queue_.front());
  if (!is_member(head)) return;
  ledger_->groups().arrive(head, iteration);
  // all members use the largest rounding carry
  if (head.pace == Pace::duration) {
    ledger_->groups().offer(head, iteration, carry_.carried());
  }
}

void ActuatorQueue::plan_with_others(Iteration iteration, const std::byte* observed) noexcept {
  if (queue_.empty()) return;
  const RecordHead& head = pool_->head(queue_.front());
  if (!is_member(head) || !CommandGroups::agrees_on_rows(head)) return;
  if (running_ && iteration <= motion_.last()) return;
  if (!running_) {
    if (!ledger_->groups().is_complete(head, iteration)) return;
    begin_command(iteration);
  }
  plan_row(iteration, observed);
  ledger_->groups().offer(head, iteration, row_iterations_);
  planned_ = true;
}

/// The next row of the command => to; false if there is none.
bool ActuatorQueue::read_row() noexcept {
  if (masked_) {
    auto* row = reinterpret_cast<std::byte*>(scratch_.data());
    rows_.read(row, layout_->size());
    layout_->copy(motion_.to(), motion_.from());
    layout_->copy(motion_.to(), row, mask_.data());
  } else {
    rows_.read(motion_.to(), layout_->size());
  }
  --rows_left_;
  return true;
}

void ActuatorQueue::begin_row(Iteration iteration, const std::byte* observed) noexcept {
  const RecordHead& head = pool_->head(queue_.front());
  if (std::exchange(planned_, false)) {
    row_iterations_ = ledger_->groups().agreed(head);
    if (pace_ == Pace::fastest) limiter_.stretch_fastest(row_iterations_);
  } else {
    plan_row(iteration, observed);
  }
  motion_.begin(iteration, row_iterations_, head.profile, head.pace);
  first_row_ = false;
}

/// Reads the next waypoint: start, target, and its own number of iterations.
void ActuatorQueue::plan_row(Iteration iteration, const std::byte* observed) noexcept {
  const RecordHead& head = pool_->head(queue_.front());

  // desired, observed or the waypoint before => from
  if (!first_row_) {
    layout_->copy(motion_.from(), motion_.to());
  } else {
    layout_->copy(motion_.from(), desired_);
    limiter_.hand_over(motion_, desired_);
    if (head.start == Start::observed) {
      layout_->copy_finite(motion_.from(), observed, mask());
      motion_.start_at_from();
    }
  }
  read_row();
  if (masked_) motion_.leave_out(mask());
  row_iterations_ = iterations(head, iteration);
}

std::int64_t ActuatorQueue::iterations(const RecordHead& head, Iteration iteration) noexcept {
  switch (head.pace) {
    case Pace::direct:
      return 1;
    case Pace::fastest:
      return limiter_.plan_fastest(motion_.to(), mask());
    case Pace::iterations:
      return std::max<std::int64_t>(1, head.amount);
    case Pace::until:
      carry_.reset();
      return head.amount - iteration + 1;
    case Pace::speed:
      return iterations_at(most_, head.profile);
    case Pace::duration:
      return timed_ ? row_of_own_time() : carry_.iterations(head.amount);
  }
  return 1;
}

/// Skips waypoints that end before the next iteration; the iterations of the first that does not.
std::int64_t ActuatorQueue::row_of_own_time() noexcept {
  const auto next = [&] {
    std::int64_t end = time_;
    times_.read(&end, sizeof end);
    return end - std::exchange(time_, end);
  };
  std::int64_t duration = next();
  for (int i = 0; i < kMostPassed && rows_left_ > 0 && carry_.pass(duration); ++i) {
    read_row();
    duration = next();
  }
  return carry_.iterations(duration);
}

std::int64_t ActuatorQueue::iterations_at(double speed, Profile profile) noexcept {
  if (first_number_ == StateLayout::kNoNumber) return 1;
  if (profile == Profile::minimum_jerk) return motion_.iterations_at(first_number_, speed);
  return linear_iterations(motion_.distance(first_number_), speed);
}

}  // namespace o80
