#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "memory/segment_layout.hpp"
#include "memory/status_word.hpp"

namespace o80 {

/// The backend's end of one lane.
///
/// Trusts nothing that the frontend can write: its cursor is private, blocks are copied out in
/// whole before anybody looks at them, impossible counters reset the lane.
///
/// Writer:   the backend's thread.
/// Readers:  LaneSender.
/// Realtime: yes.
class LaneReceiver {
 public:
  LaneReceiver(const SegmentView& view, std::uint32_t lane) noexcept;

  /// Nothing was committed that was not taken: one load.
  bool is_quiet() const noexcept {
    return page_->committed.load(std::memory_order_acquire) == cursor_;  // sync lane
  }
  /// Committed blocks not taken yet; resets the lane if that is impossible.
  std::uint32_t available() noexcept;
  /// The same, as far as one owner sent them: no batch is of two.
  std::uint32_t available_of_one() noexcept;
  /// Copies the next block (64 bytes) and moves on; false if none is committed.
  bool take(std::byte* block) noexcept;
  /// 8 bytes at `offset` of the next block, to be asked only if one is available.
  std::uint64_t peek_word(std::size_t offset) const noexcept;
  /// Forgets what is committed and not taken: after garbage. What was taken stays in flight, and
  /// what the present owner sent behind the garbage of another stays committed.
  void reset() noexcept;
  /// Looks for a new owner. Its first batch may lie before the cursor, if a former owner took back
  /// what it had committed.
  void meet_owner() noexcept;
  /// How often that happened.
  std::uint64_t resets() const noexcept { return resets_; }

  /// Gives back blocks that were taken; the sender sees it at the next flush.
  void free(std::uint32_t blocks) noexcept;
  /// Blocks taken and not given back.
  std::uint64_t in_flight() const noexcept { return cursor_ - freed_; }

  /// Visible at once; nobody is to be woken before flag() and flush().
  void set_status(std::uint64_t id, StatusWord word) noexcept;
  /// A text for an id, cut to 247 bytes; to be written before the status that it explains.
  void set_message(std::uint64_t id, std::string_view text) noexcept;
  /// Whether a batch may have this id: ids grow, by limited steps. An owner that could choose any
  /// id could make the statuses of later owners unreadable.
  bool expects(std::uint64_t id) const noexcept { return id - ids_ <= kMostSkippedIds; }
  /// A batch was staged whose ids end before `ids_end`; for the next owner, should this one die.
  void note_ids(std::uint64_t ids_end) noexcept;
  /// Flags.
  void set_burst_done(std::uint64_t id, Iteration row, BurstEnd end = BurstEnd::done) noexcept;
  /// Its sender wants the burst of the batch `id` to end. Of many cancelled at once only the newest
  /// are known.
  bool is_cancelled(std::uint64_t id) const noexcept;
  /// Asks for the lane's waiters to be woken at the next flush.
  void flag() noexcept { flagged_ = has_news_ = true; }
  /// flush() has something to do.
  bool has_news() const noexcept { return has_news_; }
  /// Publishes what was freed and moves the events, both only if there is cause; once an iteration.
  /// True if somebody sleeps until then.
  bool flush() noexcept;

  /// Newest row that the owner knew when it last showed life, as it says itself.
  Iteration life() const noexcept { return page_->life.load(std::memory_order_relaxed); }
  /// Owner of the lane as its page has it: a count, 0 if never taken; and the last that closed.
  std::uint64_t incarnation() const noexcept;
  std::uint64_t closed() const noexcept;
  /// The last owner that died and has a successor: its count, else 0. Meets the owner.
  std::uint64_t dead_predecessor() noexcept;
  /// The next batch was sent by that one.
  bool next_is_of_dead() noexcept;
  /// The owner that sent what is next: its count, or 0 if another has the lane since. To be asked
  /// after `available`.
  std::uint64_t owner_of_next() const noexcept {
    return static_cast<std::int64_t>(first_ - cursor_) > 0 ? 0 : owner_;
  }

 private:
  bool is_possible(std::uint64_t cursor) const noexcept;
  /// What was taken stays in flight.
  void move_to(std::uint64_t cursor) noexcept;

  LaneSenderPage* page_;
  LaneFeedback* feedback_;
  StatusSlot* statuses_;
  std::byte* transport_;
  std::uint64_t mask_;
  std::uint64_t cursor_ = 0;
  std::uint64_t committed_ = 0;  // as last read
  std::uint64_t freed_ = 0;
  std::uint64_t freed_published_ = 0;
  std::uint64_t bursts_ = 0;
  std::uint64_t messages_ = 0;
  std::uint64_t resets_ = 0;
  std::uint64_t ids_ = 1;    // all below belong to batches that were staged
  std::uint64_t owner_ = 0;  // as last met: its incarnation,
  std::uint64_t first_ = 0;  // and what was committed before it
  bool flagged_ = false;
  bool has_news_ = false;
};

/// What no batch bears as its ticket.
inline constexpr std::uint64_t kNoTicket = ~std::uint64_t{0};

/// All lanes, and the order of their batches.
///
/// Writer / Readers / Realtime: as LaneReceiver.
class LaneReceivers {
 public:
  /// `ticket_offset`: where in its first block a batch bears its ticket.
  LaneReceivers(const SegmentView& view, std::size_t ticket_offset);

  std::uint32_t size() const noexcept { return static_cast<std::uint32_t>(lanes_.size()); }
  LaneReceiver& operator[](std::uint32_t lane) noexcept { return lanes_[lane]; }
  const LaneReceiver& operator[](std::uint32_t lane) const noexcept { return lanes_[lane]; }

  /// Begins to look for batches: remembers bell and tickets. False if nothing can be there.
  bool look() noexcept;
  /// The lane whose next batch is the next of all below the remembered ticket. Empty when there is
  /// no more. `begun` has a ticket for each lane whose next batch was taken from it at least in
  /// part; without it, the batch is to be taken whole (or the lane reset) before the next call.
  std::optional<std::uint32_t> next(std::span<const std::uint64_t> begun = {}) noexcept;
  /// Whether a lane has a batch below the remembered ticket, to be asked between batches.
  bool has_batch(std::uint32_t lane) noexcept {
    const std::uint64_t ticket = ticket_of(lane);
    return ticket != kNoTicket && is_seen(ticket);
  }
  /// The next ticket that will be drawn.
  std::uint64_t tickets_drawn() const noexcept;
  /// This ticket, or the count of tickets if nobody can have drawn it yet.
  std::uint64_t drawn_at_most(std::uint64_t ticket) const noexcept {
    return ticket < below_ ? ticket : std::min(ticket, tickets_drawn());
  }
  /// Whether somebody has put back the count of tickets since this was last asked.
  bool tickets_were_put_back() noexcept { return std::exchange(put_back_, false); }
  /// Makes the next look() look whatever the bell says (a lane's owner died).
  void look_again() noexcept { pending_ = true; }
  /// The same if next() saw more than this lane's, or it has more; what is committed later rings.
  void look_again_after(std::uint32_t lane) noexcept {
    pending_ = others_wait_ || !lanes_[lane].is_quiet();
  }
  /// The last look() has left something, for all that is known.
  bool has_pending() const noexcept { return pending_; }
  /// The bell as look() found it, for BellWaiter::wait.
  std::uint32_t bell_seen() const noexcept { return bell_seen_; }
  /// flush() on every lane; true if those who sleep on `lane_wake` are to be woken.
  bool announce() noexcept;

 private:
  /// 0 stands for one that nobody drew.
  bool is_seen(std::uint64_t ticket) const noexcept { return ticket < below_ || ticket == 0; }
  /// Of the lane's next batch; kNoTicket if there is none.
  std::uint64_t ticket_of(std::uint32_t lane) noexcept;

  SegmentView view_;
  std::size_t ticket_offset_;
  std::vector<LaneReceiver> lanes_;
  std::uint32_t bell_seen_ = 0;
  std::uint64_t below_ = 0;
  bool put_back_ = false;
  bool pending_ = true;
  bool others_wait_ = true;  // besides the lane that next() named last
};

}  // namespace o80
