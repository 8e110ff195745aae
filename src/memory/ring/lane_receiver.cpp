#include "memory/ring/lane_receiver.hpp"

#include "base/crash_point.hpp"

namespace o80 {

LaneReceiver::LaneReceiver(const SegmentView& view, std::uint32_t lane, bool* any_news) noexcept
    : page_(&view.lane(lane)),
      feedback_(&view.feedback(lane)),
      statuses_(view.statuses(lane)),
      transport_(view.transport(lane)),
      mask_(view.shape.lane_blocks - 1),
      any_news_(any_news) {}

std::uint32_t LaneReceiver::available() noexcept {
  committed_ = page_->committed.load(std::memory_order_acquire);  // sync lane
  poll_owner();
  if (!is_possible(cursor_)) reset();
  return static_cast<std::uint32_t>(committed_ - cursor_);
}

std::uint32_t LaneReceiver::available_of_one() noexcept {
  const std::uint32_t all = available();
  const std::uint64_t of_another = first_ - cursor_;
  return of_another - 1 < all ? static_cast<std::uint32_t>(of_another) : all;
}

/// Valid counters: at most one lane of blocks is in flight, and `committed` never decreases.
bool LaneReceiver::is_possible(std::uint64_t cursor) const noexcept {
  return committed_ - cursor <= mask_ + 1 - in_flight();
}

std::uint64_t LaneReceiver::peek_word(std::size_t offset) const noexcept {
  std::uint64_t word;
  load_words(reinterpret_cast<std::byte*>(&word),
             transport_ + (cursor_ & mask_) * kBlockSize + offset, 8);
  return word;
}

void LaneReceiver::reset() noexcept {
  const std::uint64_t former = owner_;
  committed_ = page_->committed.load(std::memory_order_acquire);  // sync lane
  poll_owner();
  const bool is_of_another = owner_ != former || static_cast<std::int64_t>(first_ - cursor_) > 0;
  move_to(is_of_another && is_possible(first_) ? first_ : committed_);
  ++resets_;
  flag();
}

void LaneReceiver::on_new_owner(std::uint64_t owner) noexcept {
  owner_ = owner;
  feedback_->incarnation.store(owner, std::memory_order_release);  // sync met
  first_ = page_->owner_begin.load(std::memory_order_relaxed);
  if (static_cast<std::int64_t>(cursor_ - first_) > 0) move_to(first_);
}

void LaneReceiver::move_to(std::uint64_t cursor) noexcept {
  freed_ = cursor - in_flight();
  cursor_ = cursor;
  note_news();
}

void LaneReceiver::free(std::uint32_t blocks) noexcept {
  freed_ += std::min<std::uint64_t>(blocks, in_flight());
  note_news();
}

void LaneReceiver::set_status_word(std::uint64_t id, std::uint64_t word,
                                   std::uint16_t late) noexcept {
  StatusSlot& slot = statuses_[id & (2 * (mask_ + 1) - 1)];
  const std::uint64_t owner = StatusWord::announcing(slot.id.load(std::memory_order_relaxed));
  if (owner > id) return;  // the slot belongs to a later id: this one is forgotten
  if (owner != id) {
    // announce the new id first: a reader never sees the new id with the old status
    slot.word.store(StatusWord::announcing(id), std::memory_order_relaxed);
    O80_CRASH_POINT("status.before_id");
    slot.id.store(id, std::memory_order_release);  // sync status_id
  }
  if (late != 0) {
    slot.id.store(id | static_cast<std::uint64_t>(late) << 48, std::memory_order_relaxed);
  }
  O80_CRASH_POINT("status.before_word");
  slot.word.store(word, std::memory_order_release);  // sync status
  O80_CRASH_POINT("status.after_word");
}

void LaneReceiver::set_message(std::uint64_t id, std::string_view text) noexcept {
  MessageSlot& slot = feedback_->messages[messages_++ % kMessages];
  slot.id.store(0, std::memory_order_relaxed);
  O80_CRASH_POINT("message.before_text");
  store_text(slot.text, std::size(slot.text), text);
  O80_CRASH_POINT("message.before_id");
  slot.id.store(id, std::memory_order_release);  // sync message
}

void LaneReceiver::note_ids(std::uint64_t ids_end) noexcept {
  ids_ = std::max(ids_, ids_end);
  O80_CRASH_POINT("staged.before");
  feedback_->ids.store(ids_, std::memory_order_relaxed);
  O80_CRASH_POINT("staged.after");
}

namespace {

void write_burst(BurstSlot& slot, std::uint64_t id, Iteration row) noexcept {
  slot.id.store(0, std::memory_order_relaxed);
  O80_CRASH_POINT("burst.before_row");
  slot.row.store(row, std::memory_order_release);  // sync burst_row
  O80_CRASH_POINT("burst.before_id");
  slot.id.store(id, std::memory_order_release);  // sync burst
}

}  // namespace

void LaneReceiver::set_burst_done(std::uint64_t id, Iteration row, BurstEnd end) noexcept {
  if (end == BurstEnd::cut) row += kCutBurst;
  O80_CRASH_POINT("burst.before");
  write_burst(feedback_->recent_bursts[bursts_ % kBurstsKept], id, row);
  O80_CRASH_POINT("burst.before_newest");
  write_burst(feedback_->burst, id, row);
  feedback_->bursts.store(++bursts_, std::memory_order_release);  // sync bursts
  O80_CRASH_POINT("burst.after");
  flag();
}

bool LaneReceiver::is_among_cancelled(std::uint64_t id) const noexcept {
  return std::ranges::any_of(page_->cancelled, [&](const std::atomic<std::uint64_t>& cancelled) {
    return cancelled.load(std::memory_order_acquire) == id;  // sync cancelled
  });
}

bool LaneReceiver::flush() noexcept {
  has_news_ = false;
  if (freed_ != freed_published_) {
    freed_published_ = freed_;
    O80_CRASH_POINT("lane.before_freed");
    feedback_->freed.store(freed_, std::memory_order_release);  // sync freed
    O80_CRASH_POINT("lane.after_freed");
  }
  if (!flagged_) return false;
  flagged_ = false;

  // clear `waiting` before `events` changes: a sleeper that sets it later sees the new `events`
  std::atomic<std::uint32_t>& waiting = page_->waiting;
  bool sleepers = waiting.load(std::memory_order_seq_cst) != 0;  // sync waiting
  if (sleepers) waiting.store(0, std::memory_order_seq_cst);     // sync waiting
  O80_CRASH_POINT("events.before");
  feedback_->events.fetch_add(1, std::memory_order_seq_cst);  // sync events
  O80_CRASH_POINT("events.after");
  return sleepers || waiting.load(std::memory_order_seq_cst) != 0;  // sync waiting
}

bool LaneReceiver::next_is_of_dead() noexcept {
  // blocks before `successor_begin` were committed by the dead owner
  const std::uint64_t begin = page_->successor_begin.load(std::memory_order_relaxed);
  return dead_predecessor() != 0 && static_cast<std::int64_t>(cursor_ - begin) < 0;
}

LaneReceivers::LaneReceivers(const SegmentView& view, std::size_t ticket_offset)
    : view_(view), ticket_offset_(ticket_offset) {
  lanes_.reserve(view.shape.lanes);
  for (std::uint32_t i = 0; i < view.shape.lanes; ++i) lanes_.emplace_back(view, i, &any_news_);
}

bool LaneReceivers::poll() noexcept {
  const std::uint32_t bell = view_.bell().rung.load(std::memory_order_acquire);  // sync bell
  if (bell == bell_seen_ && !pending_) return false;
  bell_seen_ = bell;
  const std::uint64_t drawn = tickets_drawn();
  put_back_ = put_back_ || drawn < below_;
  below_ = drawn;
  pending_ = true;
  others_wait_ = true;  // until next() knows better
  return true;
}

std::uint64_t LaneReceivers::tickets_drawn() const noexcept {
  return view_.bell().tickets.load(std::memory_order_seq_cst);  // sync tickets
}

std::uint64_t LaneReceivers::ticket_of(std::uint32_t lane) noexcept {
  if (lanes_[lane].is_quiet() || lanes_[lane].available() == 0) return kNoTicket;
  const std::uint64_t ticket = lanes_[lane].peek_word(ticket_offset_);
  // an invalid ticket (above the counter) becomes 0: the batch is kept, its order is lost
  return ticket < below_ || ticket < tickets_drawn() ? ticket : 0;
}

std::optional<std::uint32_t> LaneReceivers::next(std::span<const std::uint64_t> begun) noexcept {
  std::optional<std::uint32_t> first;
  std::uint64_t lowest = below_;
  bool left_over = false;
  others_wait_ = false;
  for (std::uint32_t i = 0; i < size(); ++i) {
    const bool is_begun = !begun.empty() && begun[i] != kNoTicket;
    const std::uint64_t ticket = is_begun ? begun[i] : ticket_of(i);
    if (ticket == kNoTicket) continue;
    if (!is_begun && !is_seen(ticket)) {
      left_over = true;
      continue;
    }
    others_wait_ = others_wait_ || first;
    if (first && ticket >= lowest) continue;
    first = i;
    lowest = ticket;
  }
  others_wait_ = others_wait_ || left_over;
  if (!first) pending_ = left_over;
  return first;
}

bool LaneReceivers::flush() noexcept {
  bool sleepers = false;
  for (LaneReceiver& lane : lanes_)
    if (lane.has_news()) sleepers = lane.flush() || sleepers;
  // after `events`: a sleeper that has read the old `lane_wake` before does not sleep on it
  if (sleepers) view_.wakes().lane_wake.fetch_add(1, std::memory_order_seq_cst);  // sync lane_wake
  return sleepers;
}

}  // namespace o80
