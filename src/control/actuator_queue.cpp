#include "o80/control/actuator_queue.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "o80/control/record_check.hpp"

namespace o80 {

ActuatorQueue::ActuatorQueue(const Schema& schema, const ActuatorRow& row,
                             const StateLayout& layout, BlockPool& pool, Ledger& ledger,
                             std::byte* desired, std::uint32_t lanes)
    : layout_(&layout),
      pool_(&pool),
      ledger_(&ledger),
      desired_(desired),
      motion_(layout),
      clamp_(schema, row, layout),
      carry_(schema.head.period),
      period_(static_cast<double>(schema.head.period) / 1e9),
      when_idle_(row.when_idle),
      queue_(pool, lanes),
      mask_(mask_words(static_cast<std::uint32_t>(layout.numbers().size()))),
      scratch_((layout.size() + 7) / 8) {}

void ActuatorQueue::drop(Status status, Reason reason, Iteration iteration) noexcept {
  if (status != Status::overwritten) {
    motion_.rest();
  } else if (running_ && clamped_) {
    motion_.rest();
  } else if (running_) {
    motion_.keep_moving();
  }
  carry_.reset();
  running_ = false;
  while (!queue_.empty()) ledger_->drop(queue_.take_any(), status, reason, iteration);
}

void ActuatorQueue::halt() noexcept {
  motion_.rest();
  carry_.reset();
  running_ = false;
}

void ActuatorQueue::drop_lane(std::uint32_t lane, Status status, Reason reason,
                              Iteration iteration) noexcept {
  if (running_ && queue_.front_lane() == lane) halt();
  ledger_->drop(queue_.take(lane), status, reason, iteration);
  if (queue_.empty()) halt();
}

ActuatorQueue::Moved ActuatorQueue::step(Iteration iteration, const std::byte* observed,
                                         std::uint32_t& late_budget) noexcept {
  if (running_) {
    if (iteration > motion_.last()) begin_row(iteration, observed);
  } else if (!begin_next(iteration, observed, late_budget)) {
    return empty() ? Moved::idle : Moved::waiting;
  }
  if (clamp_.any()) {
    auto* previous = reinterpret_cast<std::byte*>(scratch_.data());
    layout_->copy(previous, desired_);
    motion_.state(iteration, desired_);
    clamped_ = clamp_.apply(desired_, previous);
  } else {
    motion_.state(iteration, desired_);
  }
  if (iteration >= motion_.last() && rows_left_ == 0) end_running(iteration);
  return clamped_ ? Moved::clamped : Moved::active;
}

void ActuatorQueue::end_running(Iteration iteration) noexcept {
  const BlockIndex record = queue_.front();
  running_ = false;
  queue_.pop();
  if (clamped_) {
    ledger_->end(record, Status::limited, Reason::limits, 0, iteration);
  } else {
    ledger_->end(record, Status::completed, Reason::none, 0, iteration);
  }
}

bool ActuatorQueue::begin_next(Iteration iteration, const std::byte* observed,
                               std::uint32_t& late_budget) noexcept {
  // skip what was to end before now
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
  if (queue_.empty()) return false;

  // mask, times and rows of the command lie behind its head
  const BlockIndex record = queue_.front();
  const RecordHead& head = pool_->head(record);
  rows_ = Cursor(*pool_, record, sizeof(RecordHead), head.payload_bytes);
  partial_ = head.partial != 0;
  if (partial_) rows_.read(mask_.data(), mask_.size() * sizeof mask_.front());
  timed_ = head.pace == Pace::duration && head.rows > 1;
  time_ = 0;
  if (timed_) {
    // the check has noted where the rows begin
    times_ = rows_;
    rows_ = rows_of_timed(*pool_, head, layout_->size());
  }
  rows_left_ = head.rows;
  first_row_ = true;
  running_ = true;
  clamped_ = false;
  ledger_->activate(record, iteration);
  begin_row(iteration, observed);
  return true;
}

void ActuatorQueue::begin_row(Iteration iteration, const std::byte* observed) noexcept {
  const RecordHead& head = pool_->head(queue_.front());
  const std::uint64_t* mask = partial_ ? mask_.data() : nullptr;

  // desired or observed => from
  layout_->copy(motion_.from(), desired_);
  if (first_row_ && head.start == Start::observed) layout_->copy(motion_.from(), observed, mask);

  // the row of the command => to
  if (partial_) {
    auto* row = reinterpret_cast<std::byte*>(scratch_.data());
    rows_.read(row, layout_->size());
    layout_->copy(motion_.to(), motion_.from());
    layout_->copy(motion_.to(), row, mask);
  } else {
    rows_.read(motion_.to(), layout_->size());
  }
  --rows_left_;
  motion_.begin(iteration, iterations(head, iteration), head.profile, head.pace);
  first_row_ = false;
}

std::int64_t ActuatorQueue::iterations(const RecordHead& head, Iteration iteration) noexcept {
  switch (head.pace) {
    case Pace::direct:
    case Pace::fastest:
      return 1;
    case Pace::iterations:
      return std::max<std::int64_t>(1, head.amount);
    case Pace::until:
      carry_.reset();
      return head.amount - iteration + 1;
    case Pace::speed:
      return iterations_at(head.speed * period_, head.profile);
    case Pace::duration: {
      if (!timed_) return carry_.iterations(head.amount);
      std::int64_t end = time_;
      times_.read(&end, sizeof end);
      return carry_.iterations(end - std::exchange(time_, end));
    }
  }
  return 1;
}

std::int64_t ActuatorQueue::iterations_at(double speed, Profile profile) noexcept {
  if (!layout_->numbers().front().moves()) return 1;
  const double distance = layout_->number(0, motion_.to()) - layout_->number(0, motion_.from());
  if (std::isnan(distance)) return 1;
  if (profile == Profile::minimum_jerk) {
    return minimum_jerk_iterations(distance, motion_.first_moment(), speed);
  }
  return distance == 0.0 ? 1 : linear_iterations(distance, speed);
}

void ActuatorQueue::settle(const std::byte* observed) noexcept {
  halt();
  if (follows()) return follow(observed);
  if (layout_->hooks().hold == nullptr) return;
  // in an aligned place of its own, so that no padding reaches the row
  std::byte* held = motion_.to();
  layout_->copy(held, desired_);
  layout_->hooks().hold(held);
  layout_->copy(desired_, held);
}

}  // namespace o80
