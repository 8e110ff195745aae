#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "memory/ring/status_word.hpp"
#include "memory/segment/attached_segment.hpp"
#include "memory/segment/signal.hpp"
#include "o80/base/error.hpp"

namespace o80 {

inline constexpr std::int64_t kShortestSlice = 100'000;  // between signs of life in a wait [ns]

/// The error for a batch of `needed` blocks if only `free` of `most` blocks can be used.
LaneFull lane_full(std::string_view segment, std::uint64_t needed, std::uint32_t free,
                   std::uint32_t most);

/// Neither movable nor copyable: a lane owned by a frontend (src/memory/README.md#lanes). The
/// destructor releases it; the kernel does if the process dies.
///
/// Ids and positions continue where the former owner stopped.
///
/// Writer:   one thread at a time for next_id, draw_ids, free_blocks and send.
/// Readers:  the backend; statuses, bursts, messages and waits: any thread of the owner.
/// Realtime: send and the queries; not construction, not waits.
class LaneSender {
 public:
  enum class Known { not_yet, yes, forgotten };
  struct StatusAnswer {
    Known known;
    StatusWord word;  // valid if known == yes
    std::uint16_t late = 0;
  };
  struct BurstAnswer {
    Known known;
    Iteration row;  // row of its last iteration, valid if known == yes
    BurstEnd end = BurstEnd::done;
  };

  /// Acquires the first free lane of a segment attached with Access::read_write. The segment must
  /// outlive it. Throws NoLane (with the owners of the lanes), ReadOnly, UsedAfterFork.
  explicit LaneSender(const AttachedSegment& segment);
  LaneSender& operator=(LaneSender&&) = delete;
  ~LaneSender();

  /// Releases the lane. Queries stay valid; send() is not allowed any more.
  void give_back() noexcept;

  std::uint32_t lane() const noexcept { return lane_; }
  std::uint64_t incarnation() const noexcept { return incarnation_; }
  /// Blocks of the lane: the size of the largest batch.
  std::uint32_t blocks() const noexcept { return view_.shape.lane_blocks; }
  /// Blocks that can be sent now.
  std::uint32_t free_blocks() const noexcept;
  /// The lowest unused id, from 1.
  std::uint64_t next_id() const noexcept { return next_id_; }
  /// Marks all ids below `next` as used. Ids never decrease.
  void draw_ids(std::uint64_t next) noexcept;
  /// Number of status slots; the slot of an id is id modulo this.
  std::uint64_t statuses() const noexcept { return 2 * std::uint64_t{blocks()}; }
  /// Copies a batch of whole blocks, draws its ticket, writes the ticket at `ticket_offset` (a
  /// multiple of 8) of the first block, commits all with one store, and rings the bell. Returns the
  /// ticket. Throws LaneFull (nothing is sent), UsedAfterFork.
  std::uint64_t send(std::span<const std::byte> batch, std::size_t ticket_offset);

  /// Cancels the burst of the batch `id`: it ends after the present iteration, or before its first.
  /// Any thread may call it; no effect once the lane is released.
  void cancel_burst(std::uint64_t id) noexcept;

  StatusAnswer status(std::uint64_t id) const noexcept;
  /// The text of a status, if the backend has stored one that was not overwritten.
  std::optional<std::string> message(std::uint64_t id) const;
  /// The result of the burst of the batch `id`.
  BurstAnswer burst(std::uint64_t id) const noexcept;

  /// Gives a sign of life to the watchdog of the backend.
  void show_life() noexcept {
    // a released lane may have another owner, and the page is still writable
    if (!lock_.is_open()) return;
    page_->life.store(view_.counters().published.load(std::memory_order_relaxed),
                      std::memory_order_relaxed);
  }
  /// Waits give a sign of life at least this often [ns]; for a backend with a watchdog.
  void show_life_every(std::int64_t slice) noexcept {
    slice_ = std::clamp<std::int64_t>(slice, kShortestSlice, kSlice);
    watched_ = true;
  }

  /// A count that changes when the backend has flagged this lane.
  std::uint32_t events() const noexcept {
    return feedback_->events.load(std::memory_order_acquire);  // sync events
  }
  /// Waits until done() is true. done() is called whenever events() has changed.
  /// `events_before_send` is the event count before the awaited batch was sent: done() is not
  /// called while the count is unchanged. Throws BackendGone (any kind) and Cancelled.
  template <class Done>
  Waited wait_until(Done&& done, const Deadline& deadline, const KeepWaiting& keep_waiting = {},
                    std::optional<std::uint32_t> events_before_send = {}) {
    std::int64_t poll_at = 0;
    std::int64_t nap = slice_;  // time until poll_at [ns]
    while (true) {
      if (watched_) show_life();
      const std::uint32_t seen = events();
      if (seen != events_before_send && done()) return Waited::ready;
      if (spinner_.spin([&] { return events() != seen; }) && done()) return Waited::ready;
      if (deadline.over()) {
        // a wait shorter than one slice checks for the end of the backend too
        const bool gone = segment_->gone();
        if (done()) return Waited::ready;
        if (gone) segment_->throw_if_gone();
        return Waited::timed_out;
      }
      if (poll_at == 0) poll_at = monotonic_now() + slice_;
      sleep(seen, deadline.left(nap));
      nap = poll_at - monotonic_now();
      if (nap > 0 && !segment_->has_ended()) continue;
      poll_at = monotonic_now() + slice_;
      nap = slice_;
      // first the end, then the result: a result counts even if the backend has ended since
      const bool gone = poll(keep_waiting);
      if (done()) return Waited::ready;
      if (gone) segment_->throw_if_gone();
    }
  }

 private:
  void count_in();
  /// Sleeps until `events` is no longer `seen`, at most so long [ns].
  void sleep(std::uint32_t seen, std::int64_t at_most);
  /// True if the backend has ended. Throws Cancelled.
  bool poll(const KeepWaiting& keep_waiting) const;

  const AttachedSegment* segment_;
  SegmentView view_;
  LockFile lock_;
  std::uint32_t lane_ = 0;
  LaneSenderPage* page_ = nullptr;
  const LaneFeedback* feedback_ = nullptr;
  const StatusSlot* statuses_ = nullptr;
  std::byte* transport_ = nullptr;
  std::uint64_t incarnation_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t next_id_ = 1;
  std::uint32_t draws_ = 0;
  std::int64_t slice_ = kSlice;
  bool watched_ = false;
  Spinner spinner_;
  ForkGuard guard_;
};

}  // namespace o80
