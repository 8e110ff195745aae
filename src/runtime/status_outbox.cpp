#include "runtime/status_outbox.hpp"

#include "control/visit_block.hpp"

namespace o80 {

void StatusOutbox::put(const StatusChange& change) noexcept {
  const bool waits = stepping_ && is_end(change.status) && waiting_.size() < waiting_.capacity();
  if (waits) {
    const bool began_now = begun_.id == change.id && begun_.lane == change.lane;
    if (began_now) {
      begun_.id = 0;
    } else {
      note_begin();
    }
    waiting_.push_back(change);
    return;
  }
  note_begin();
  const bool begins =
      stepping_ && change.status == Status::active && change.of == StatusChange::Of::record;
  if (begins) {
    begun_ = change;
  } else {
    journal_.status(change);
  }
  report(change);
}

void StatusOutbox::note_begin() noexcept {
  if (begun_.id != 0) journal_.status(begun_);
  begun_.id = 0;
}

void StatusOutbox::report_row() noexcept {
  // first the journal: it has each end that a frontend sees
  for (const StatusChange& change : waiting_) journal_.status(change);
  journal_.flush();
  for (const StatusChange& change : waiting_) report(change);
  waiting_.clear();
}

void StatusOutbox::report_no_row() noexcept {
  for (StatusChange& change : waiting_) {
    if (change.status != Status::completed && change.status != Status::limited) continue;
    change.status = Status::purged;
    change.reason = Reason::stopped;
  }
  report_row();
}

void StatusOutbox::report(const StatusChange& change) noexcept {
  O80_COUNT(status_told);
  LaneReceiver& lane = lanes_[change.lane];
  lane.set_status(change.id,
                  {static_cast<std::uint8_t>(change.status),
                   static_cast<std::uint8_t>(change.reason), change.detail, change.iteration});
  if (is_end(change.status)) lane.flag();
}

}  // namespace o80
