#include "runtime/backend/status_outbox.hpp"

#include "control/motion/visit_block.hpp"

namespace o80 {

void StatusOutbox::put(const StatusChange& change) noexcept {
  const StatusWord word{static_cast<std::uint8_t>(change.status),
                        static_cast<std::uint8_t>(change.reason), change.detail, change.iteration};
  const Run now{change.id,   word.packed(), 1,
                change.lane, change.late,   change.of == StatusChange::Of::record};
  const bool ends = is_end(change.status);
  if (!stepping_) return report_now(now, ends);
  if (ends && waiting_.size() < waiting_.capacity()) {
    if (begun_.first_id == now.first_id && begun_.lane == now.lane) begun_.count = 0;
    report_begin();
    return wait(now);
  }
  report_begin();
  if (change.status != Status::active || !now.of_records) return report_now(now, ends);
  begun_ = now;
}

void StatusOutbox::wait(const Run& end) noexcept {
  if (!waiting_.empty()) {
    Run& last = waiting_.back();
    if (end.first_id == last.first_id + last.count && end.word == last.word &&
        end.lane == last.lane && end.late == last.late && end.of_records == last.of_records) {
      ++last.count;
      return;
    }
  }
  waiting_.push_back(end);
}

void StatusOutbox::report_the_begin() noexcept {
  report_now(begun_, false);
  begun_.count = 0;
}

void StatusOutbox::report_now(const Run& run, bool ends) noexcept {
  note(run);
  report(run, ends);
}

void StatusOutbox::report_waiting() noexcept {
  // first the journal: it has each end that a frontend sees
  for (const Run& end : waiting_) note(end);
  journal_.flush();
  for (const Run& end : waiting_) report(end, true);
  waiting_.clear();
}

void StatusOutbox::report_no_row() noexcept {
  for (Run& end : waiting_) {
    StatusWord word = StatusWord::unpack(end.word);
    const auto status = static_cast<Status>(word.status);
    if (status != Status::completed) continue;
    word.status = static_cast<std::uint8_t>(Status::purged);
    word.reason = static_cast<std::uint8_t>(Reason::stopped);
    end.word = word.packed();
  }
  report_row();
}

/// Reports to the lane.
void StatusOutbox::report(const Run& run, bool ends) noexcept {
  LaneReceiver& lane = lanes_[run.lane];
  for (std::uint32_t i = 0; i < run.count; ++i) {
    O80_COUNT(status_told);
    lane.set_status_word(run.first_id + i, run.word, run.late);
  }
  if (ends) lane.flag();
}

}  // namespace o80
