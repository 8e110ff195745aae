#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "memory/os/atomic_words.hpp"
#include "memory/ring/status_word.hpp"
#include "memory/segment/segment_layout.hpp"

namespace o80 {

/// The backend's end of one lane (src/memory/README.md#lanes).
///
/// Every value that a frontend can write is checked: the cursor is private, blocks are copied
/// before they are read, impossible counters reset the lane.
///
/// Writer:   the backend's thread.
/// Readers:  LaneSender.
/// Realtime: yes.
class LaneReceiver {
 public:
  LaneReceiver(const SegmentView& view, std::uint32_t lane, bool* any_news = nullptr) noexcept;

  /// True if all committed blocks were taken: one load.
  bool is_quiet() const noexcept {
    return page_->committed.load(std::memory_order_acquire) == cursor_;  // sync lane
  }
  /// Number of committed blocks that were not taken; resets the lane if its counters are
  /// impossible.
  std::uint32_t available() noexcept;
  /// The same, but only blocks of one owner: a batch never spans two owners.
  std::uint32_t available_of_one() noexcept;
  /// Copies the next block (64 bytes) and advances the cursor; false if none is committed.
  bool take(std::byte* block) noexcept {
    if (cursor_ == committed_ && available() == 0) return false;
    load_words(block, transport_ + (cursor_ & mask_) * kBlockSize, kBlockSize);
    ++cursor_;
    return true;
  }
  /// The 8 bytes at `offset` of the next block. Call it only if available() is not 0.
  std::uint64_t peek_word(std::size_t offset) const noexcept;
  /// Skips committed blocks that were not taken, after invalid data. Taken blocks stay in flight.
  /// Blocks that the present owner sent behind invalid data of a former owner are kept.
  void reset() noexcept;
  /// Reads whether the lane has a new owner. Moves the cursor back to its first batch if a former
  /// owner has decreased `committed`.
  void poll_owner() noexcept {
    const std::uint64_t owner = incarnation();
    if (owner != owner_) on_new_owner(owner);
  }
  /// Number of resets so far.
  std::uint64_t resets() const noexcept { return resets_; }

  /// Frees blocks that were taken; the sender sees it after the next flush.
  void free(std::uint32_t blocks) noexcept;
  /// Number of taken blocks that were not freed.
  std::uint64_t in_flight() const noexcept { return cursor_ - freed_; }

  /// Visible at once; waiters wake up after flag() and flush().
  void set_status(std::uint64_t id, StatusWord word) noexcept {
    set_status_word(id, word.packed());
  }
  /// The same for a packed StatusWord.
  /// `late`: a further number of the status, in the bits of the slot that ids do not need.
  void set_status_word(std::uint64_t id, std::uint64_t word, std::uint16_t late = 0) noexcept;
  /// Stores a text for an id, cut to 247 bytes. Call it before the set_status() that it explains.
  void set_message(std::uint64_t id, std::string_view text) noexcept;
  /// True if a batch may have this id: ids grow by limited steps. Otherwise one owner could use up
  /// the ids, so that the statuses of later owners were unreadable.
  bool expects(std::uint64_t id) const noexcept { return id - ids_ <= kMaxSkippedIds; }
  /// A batch was staged whose ids end before `ids_end`; the next owner of the lane continues there.
  void note_ids(std::uint64_t ids_end) noexcept;
  /// The burst of the batch `id` has ended with this row. Calls flag().
  void set_burst_done(std::uint64_t id, Iteration row, BurstEnd end = BurstEnd::done) noexcept;
  /// True if the sender has cancelled the burst of the batch `id`. Only the newest kCancelsKept
  /// cancellations are known.
  bool is_cancelled(std::uint64_t id) const noexcept {
    return page_->cancels.load(std::memory_order_relaxed) != 0 && is_among_cancelled(id);
  }
  /// Wakes the waiters of the lane at the next flush.
  void flag() noexcept {
    flagged_ = true;
    note_news();
  }
  /// True if flush() has something to do.
  bool has_news() const noexcept { return has_news_; }
  /// Publishes freed blocks, and changes `events` if the lane was flagged. Call it once in each
  /// iteration. True if a thread sleeps until `events` changes.
  bool flush() noexcept;

  /// The newest row when the owner last gave a sign of life, as the owner wrote it.
  Iteration life() const noexcept { return page_->life.load(std::memory_order_relaxed); }
  /// Incarnation of the present owner; 0: the lane was never acquired.
  std::uint64_t incarnation() const noexcept {
    return possible_incarnation(
        page_->incarnation.load(std::memory_order_acquire),  // sync incarnation
        owner_);
  }
  /// Incarnation of the last owner that closed the lane.
  std::uint64_t closed() const noexcept {
    return page_->closed.load(std::memory_order_acquire);  // sync closed
  }
  /// Incarnation of the last owner that died and was replaced, else 0. Calls poll_owner().
  std::uint64_t dead_predecessor() noexcept {
    poll_owner();
    const std::uint64_t dead = page_->dead_incarnation.load(std::memory_order_relaxed);
    return dead < owner_ ? dead : 0;
  }
  /// True if the next batch was sent by the dead owner of dead_predecessor().
  bool next_is_of_dead() noexcept;
  /// Incarnation of the owner that sent the next block; 0 if it is not the present owner. Call it
  /// after available().
  std::uint64_t owner_of_next() const noexcept {
    return static_cast<std::int64_t>(first_ - cursor_) > 0 ? 0 : owner_;
  }

 private:
  bool is_possible(std::uint64_t cursor) const noexcept;
  bool is_among_cancelled(std::uint64_t id) const noexcept;
  void on_new_owner(std::uint64_t owner) noexcept;
  void note_news() noexcept {
    has_news_ = true;
    if (any_news_ != nullptr) *any_news_ = true;
  }
  /// Moves the cursor; taken blocks stay in flight.
  void move_to(std::uint64_t cursor) noexcept;

  LaneSenderPage* page_;
  LaneFeedback* feedback_;
  StatusSlot* statuses_;
  std::byte* transport_;
  std::uint64_t mask_;
  std::uint64_t cursor_ = 0;
  std::uint64_t committed_ = 0;  // value at the last load
  std::uint64_t freed_ = 0;
  std::uint64_t freed_published_ = 0;
  std::uint64_t bursts_ = 0;
  std::uint64_t messages_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t ids_ = 1;    // all ids below belong to batches that were staged
  std::uint64_t owner_ = 0;  // incarnation of the owner at the last poll_owner()
  std::uint64_t first_ = 0;  // blocks that were committed before that owner
  bool flagged_ = false;
  bool has_news_ = false;
  bool* any_news_;  // set too; or null
};

/// Stands for the absence of a ticket.
inline constexpr std::uint64_t kNoTicket = ~std::uint64_t{0};

/// All lanes of a segment, and the order of their batches by ticket.
///
/// Writer / Readers / Realtime: as LaneReceiver.
class LaneReceivers {
 public:
  /// `ticket_offset`: offset of the ticket in the first block of a batch [bytes].
  LaneReceivers(const SegmentView& view, std::size_t ticket_offset);
  LaneReceivers(const LaneReceivers&) = delete;  // lanes point to it
  LaneReceivers& operator=(const LaneReceivers&) = delete;

  std::uint32_t size() const noexcept { return static_cast<std::uint32_t>(lanes_.size()); }
  LaneReceiver& operator[](std::uint32_t lane) noexcept { return lanes_[lane]; }
  const LaneReceiver& operator[](std::uint32_t lane) const noexcept { return lanes_[lane]; }

  /// Starts a scan: stores the value of the bell and the ticket counter. False if nothing can have
  /// been committed since the last scan.
  bool poll() noexcept;
  /// The lane of the batch with the lowest ticket, if that is below the stored ticket counter; else
  /// empty. `begun` has the ticket of each batch that was taken in part, kNoTicket for other lanes.
  /// Without `begun`, take the whole batch (or reset the lane) before the next call.
  std::optional<std::uint32_t> next(std::span<const std::uint64_t> begun = {}) noexcept;
  /// True if the next batch of a lane has a ticket below the stored counter. Call it only between
  /// batches.
  bool has_batch(std::uint32_t lane) noexcept {
    const std::uint64_t ticket = ticket_of(lane);
    return ticket != kNoTicket && is_seen(ticket);
  }
  /// The ticket counter: the ticket that will be drawn next.
  std::uint64_t tickets_drawn() const noexcept;
  /// This ticket, but at most the ticket counter (a higher ticket is invalid).
  std::uint64_t drawn_at_most(std::uint64_t ticket) const noexcept {
    return ticket < below_ ? ticket : std::min(ticket, tickets_drawn());
  }
  /// True if the ticket counter has decreased since the last call (an invalid write).
  bool tickets_were_put_back() noexcept { return std::exchange(put_back_, false); }
  /// True if all committed blocks of all lanes were taken.
  bool are_quiet() const noexcept {
    return std::ranges::all_of(lanes_, [](const LaneReceiver& lane) { return lane.is_quiet(); });
  }
  /// The next poll() starts a scan even if the bell is unchanged (the owner of a lane died).
  void rescan() noexcept { pending_ = true; }
  /// The same, but only if next() found batches in other lanes, or if this lane has more. Later
  /// commits ring the bell.
  void rescan_after(std::uint32_t lane) noexcept {
    pending_ = others_wait_ || !lanes_[lane].is_quiet();
  }
  /// True if the last scan may have left batches.
  bool has_pending() const noexcept { return pending_; }
  /// The value of the bell at the last poll(), for BellWaiter::wait().
  std::uint32_t bell_seen() const noexcept { return bell_seen_; }
  /// Flushes every lane; true if a thread sleeps on `lane_wake`. The caller wakes it.
  bool announce() noexcept { return std::exchange(any_news_, false) && flush(); }

 private:
  /// True for a ticket below the stored counter, and for 0, which replaces invalid tickets.
  bool is_seen(std::uint64_t ticket) const noexcept { return ticket < below_ || ticket == 0; }
  bool flush() noexcept;
  /// Ticket of the next batch of the lane; kNoTicket if there is none.
  std::uint64_t ticket_of(std::uint32_t lane) noexcept;

  SegmentView view_;
  std::size_t ticket_offset_;
  std::vector<LaneReceiver> lanes_;
  std::uint32_t bell_seen_ = 0;
  std::uint64_t below_ = 0;
  bool any_news_ = false;  // of a lane
  bool put_back_ = false;
  bool pending_ = true;
  bool others_wait_ = true;  // next() found batches in other lanes than the one it returned
};

}  // namespace o80
