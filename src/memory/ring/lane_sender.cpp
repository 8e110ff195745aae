#include "memory/ring/lane_sender.hpp"

#include <iterator>
#include <vector>

#include "base/crash_point.hpp"
#include "memory/os/atomic_words.hpp"
#include "memory/os/futex.hpp"
#include "memory/os/prefetch.hpp"
#include "memory/segment/segment_file.hpp"
#include "o80/base/nearest_name.hpp"

namespace o80 {

namespace {

constexpr int kTries = 1000;                 // retries while a status is being written
constexpr std::uint32_t kDrawsUnasked = 64;  // draws between two reads of the backend's ids

std::string holders(const SegmentView& view) {
  std::vector<std::string> names;
  names.reserve(view.shape.lanes);
  for (std::uint32_t i = 0; i < view.shape.lanes; ++i) {
    const LaneSenderPage& page = view.lane(i);
    names.push_back(load_text(page.owner, std::size(page.owner)));
  }
  return first_names(names);
}

}  // namespace

LaneSender::LaneSender(const AttachedSegment& segment) : segment_(&segment), view_(segment.view()) {
  const std::string quoted = "segment '" + segment.name() + "'";
  if (segment.access() != Access::read_write)
    throw ReadOnly(quoted + " is attached read-only: attach it for reading and writing to command");
  lock_ = segment.open_commands_again();
  const std::uint32_t lanes = view_.shape.lanes;
  while (lane_ < lanes && !lock_.try_lock(kFirstLaneByte + lane_)) ++lane_;
  if (const std::string why = lane_ == lanes ? why_locks_are_refused() : ""; !why.empty())
    throw SegmentError(quoted + " cannot be commanded: " + why + ".");
  if (lane_ == lanes)
    throw NoLane(quoted + ": all of its " + std::to_string(lanes) + " lanes are taken, by " +
                 holders(view_) +
                 ". Close one of these frontends, or start the backend with more lanes.");

  // map our lane writable, through the descriptor without a lock
  O80_CRASH_POINT("lane.after_lock");
  Mapping::make_writable(view_.commands, segment.commands_descriptor(), view_.lane_offset(lane_),
                         view_.offsets.lane_stride);
  page_ = &view_.lane(lane_);
  feedback_ = &view_.feedback(lane_);
  statuses_ = view_.statuses(lane_);
  transport_ = view_.transport(lane_);

  // continue where the last owner stopped
  sent_ = page_->committed.load(std::memory_order_relaxed);
  // continue its ids too, unless its `next_id` is impossible
  const std::uint64_t taken =
      std::max<std::uint64_t>(1, feedback_->ids.load(std::memory_order_relaxed));
  if (page_->next_id.load(std::memory_order_relaxed) - taken > kMaxSkippedIds / 2)
    page_->next_id.store(taken, std::memory_order_relaxed);
  next_id_ = page_->next_id.load(std::memory_order_relaxed);
  store_text(page_->owner, std::size(page_->owner), own_process());
  O80_CRASH_POINT("lane.before_incarnation");
  count_in();
  O80_CRASH_POINT("lane.after_incarnation");

  // the last owner may have died between its commit and the bell
  ring_bell(view_);
}

/// Becomes the next owner; impossible values of the last owner are replaced.
void LaneSender::count_in() {
  const std::uint64_t met = feedback_->incarnation.load(std::memory_order_relaxed);
  std::uint64_t last =
      possible_incarnation(page_->incarnation.load(std::memory_order_relaxed), met);
  if (last - met == kMaxUnmetOwners) last = met;  // last + 1 would be impossible
  incarnation_ = last + 1;

  const std::uint64_t closed = page_->closed.load(std::memory_order_relaxed);
  const std::uint64_t dead = page_->dead_incarnation.load(std::memory_order_relaxed);
  const std::uint64_t begin = page_->successor_begin.load(std::memory_order_relaxed);
  // the last owner has died unless it has closed. Record that in `dead_incarnation`, because this
  // owner may end before the backend looks
  const bool died = closed != last;
  if (died || static_cast<std::int64_t>(begin - sent_) > 0)
    page_->successor_begin.store(sent_, std::memory_order_relaxed);
  O80_CRASH_POINT("lane.before_dead");
  if (died || dead >= last)
    page_->dead_incarnation.store(died ? last : 0, std::memory_order_relaxed);
  if (closed > last) page_->closed.store(0, std::memory_order_relaxed);
  page_->owner_begin.store(sent_, std::memory_order_relaxed);
  page_->incarnation.store(incarnation_, std::memory_order_release);  // sync incarnation
}

LaneSender::~LaneSender() { give_back(); }

void LaneSender::give_back() noexcept {
  if (!lock_.is_open() || guard_.forked()) return;
  O80_CRASH_POINT("lane.before_close");
  page_->closed.store(incarnation_, std::memory_order_release);  // sync closed
  O80_CRASH_POINT("lane.after_close");
  // the page stays writable: another thread may still set `waiting`
  lock_.close();
}

LaneFull lane_full(std::string_view segment, std::uint64_t needed, std::uint32_t free,
                   std::uint32_t most) {
  const std::string takes = "the batch takes " + std::to_string(needed) + " blocks of 64 bytes, ";
  const std::string lane = " lane of '" + std::string(segment) + "'";
  if (needed > most) {
    return LaneFull(takes + "a" + lane + " has " + std::to_string(most) +
                    ": send it in parts, or start the backend with larger lanes (lane_blocks)");
  }
  return LaneFull(takes + std::to_string(free) + " of " + std::to_string(most) +
                  " are free in the" + lane +
                  ". Nothing was sent, all stays added: pulse again when earlier commands have "
                  "ended, purge, or start the backend with larger lanes (lane_blocks)");
}

std::uint32_t LaneSender::free_blocks() const noexcept {
  const std::uint64_t in_flight =
      sent_ - feedback_->freed.load(std::memory_order_acquire);  // sync freed
  return in_flight > blocks() ? 0 : blocks() - static_cast<std::uint32_t>(in_flight);
}

void LaneSender::draw_ids(std::uint64_t next) noexcept {
  O80_CRASH_POINT("lane.before_ids");
  next_id_ = std::max(next, next_id_);
  // only this owner draws ids. In case a former owner still writes here, compare them now and then
  // with those that the backend has seen; not each time, because the backend writes that cache line
  if (++draws_ % kDrawsUnasked == 0)
    next_id_ = std::max(next_id_, feedback_->ids.load(std::memory_order_relaxed));
  page_->next_id.store(next_id_, std::memory_order_relaxed);
}

std::uint64_t LaneSender::send(std::span<const std::byte> batch, std::size_t ticket_offset) {
  if (guard_.forked()) guard_.check("segment '" + segment_->name() + "'");
  const std::uint64_t count = batch.size() / kBlockSize;
  const std::uint32_t free = free_blocks();
  if (count > free) throw lane_full(segment_->name(), count, free, blocks());

  // batch => transport, in two runs at most
  const std::uint64_t begin = sent_ & (blocks() - 1);
  const std::uint64_t before_end = std::min<std::uint64_t>(count, blocks() - begin) * kBlockSize;
  std::byte* first = transport_ + begin * kBlockSize;
  O80_CRASH_POINT("lane.before_copy");
  store_words(first, batch.data(), before_end);
  store_words(transport_, batch.data() + before_end, batch.size() - before_end);

  // sequentially consistent: all writes before this draw are visible after the draw of any later
  // ticket
  O80_CRASH_POINT("lane.before_ticket");
  const std::uint64_t ticket =
      view_.bell().tickets.fetch_add(1, std::memory_order_seq_cst);  // sync tickets
  store_words(first + ticket_offset, reinterpret_cast<const std::byte*>(&ticket), 8);

  sent_ += count;
  O80_CRASH_POINT("lane.before_commit");
  page_->committed.store(sent_, std::memory_order_release);  // sync lane
  O80_CRASH_POINT("lane.after_commit");
  ring_bell(view_);
  // the backend has read the next block one lap ago: fetch its line for the next batch
  prefetch_to_write(transport_ + (sent_ & (blocks() - 1)) * kBlockSize);
  return ticket;
}

void LaneSender::cancel_burst(std::uint64_t id) noexcept {
  if (!lock_.is_open() || guard_.forked()) return;
  // threads that cancel at the same time get different slots
  std::atomic<std::uint64_t>& count = page_->cancels;
  const std::uint64_t place = count.fetch_add(1, std::memory_order_relaxed) % kCancelsKept;
  page_->cancelled[place].store(id, std::memory_order_release);  // sync cancelled
  O80_CRASH_POINT("lane.after_cancel");
  ring_bell(view_);
}

LaneSender::StatusAnswer LaneSender::status(std::uint64_t id) const noexcept {
  const StatusSlot& slot = statuses_[id & (statuses() - 1)];
  for (int i = 0; i < kTries; ++i) {
    const std::uint64_t word = slot.word.load(std::memory_order_acquire);   // sync status
    const std::uint64_t slot_id = slot.id.load(std::memory_order_acquire);  // sync status_id
    const std::uint64_t owner = StatusWord::announcing(slot_id);
    if (owner > id) return {Known::forgotten, {}, 0};
    if (owner < id) return {Known::not_yet, {}, 0};
    const StatusWord known = StatusWord::unpack(word);
    if (known.status == 0) {
      if (word > StatusWord::announcing(id)) return {Known::forgotten, {}, 0};
      continue;
    }
    if (slot.word.load(std::memory_order_relaxed) == word) {
      return {Known::yes, known, static_cast<std::uint16_t>(slot_id >> 48)};
    }
  }
  return {Known::not_yet, {}, 0};
}

std::optional<std::string> LaneSender::message(std::uint64_t id) const {
  for (const MessageSlot& slot : feedback_->messages) {
    if (slot.id.load(std::memory_order_acquire) != id) continue;  // sync message
    std::string text = load_text(slot.text, std::size(slot.text));
    if (slot.id.load(std::memory_order_relaxed) == id) return text;
  }
  return std::nullopt;
}

namespace {

bool read_burst(const BurstSlot& slot, std::uint64_t id, Iteration& row) noexcept {
  if (slot.id.load(std::memory_order_acquire) != id) return false;  // sync burst
  row = slot.row.load(std::memory_order_acquire);                   // sync burst_row
  return slot.id.load(std::memory_order_relaxed) == id;
}

}  // namespace

LaneSender::BurstAnswer LaneSender::burst(std::uint64_t id) const noexcept {
  const auto answer = [](Iteration word) {
    if (word < kCutBurst) return BurstAnswer{Known::yes, word, BurstEnd::done};
    return BurstAnswer{Known::yes, word - kCutBurst, BurstEnd::cut};
  };
  Iteration row = -1;
  if (read_burst(feedback_->burst, id, row)) return answer(row);
  // the bursts of a lane end in the order of their ids
  const std::uint64_t newest = feedback_->burst.id.load(std::memory_order_acquire);  // sync burst
  if (newest != 0 && newest < id) return {Known::not_yet, -1};

  // not the newest: search the recent ones
  const std::uint64_t done = feedback_->bursts.load(std::memory_order_acquire);  // sync bursts
  const std::uint64_t kept = std::min<std::uint64_t>(done, kBurstsKept);
  for (std::uint64_t back = 1; back <= kept; ++back)
    if (read_burst(feedback_->recent_bursts[(done - back) % kBurstsKept], id, row))
      return answer(row);
  const std::uint64_t oldest = feedback_->recent_bursts[done % kBurstsKept].id.load(
      std::memory_order_acquire);  // sync burst
  return {oldest > id ? Known::forgotten : Known::not_yet, -1};
}

void LaneSender::sleep(std::uint32_t seen, std::int64_t at_most) {
  if (guard_.forked()) guard_.check("segment '" + segment_->name() + "'");
  // one futex word for all lanes, so that the loop needs one call to wake all waiters
  const std::atomic<std::uint32_t>& wake = view_.wakes().lane_wake;
  const std::uint32_t now = wake.load(std::memory_order_seq_cst);  // sync lane_wake
  page_->waiting.store(1, std::memory_order_seq_cst);              // sync waiting
  O80_CRASH_POINT("lane.before_sleep");
  // the end is stored before `lane_wake` changes: has_ended() is reliable after the load above
  if (segment_->has_ended()) return;
  if (feedback_->events.load(std::memory_order_seq_cst) == seen)  // sync events
    futex_wait(wake, now, at_most);
}

bool LaneSender::poll(const KeepWaiting& keep_waiting) const {
  if (keep_waiting && !keep_waiting())
    throw Cancelled("the wait for segment '" + segment_->name() + "' was cancelled");
  return segment_->gone();
}

}  // namespace o80
