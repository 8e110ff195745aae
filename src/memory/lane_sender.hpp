#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "memory/attached_segment.hpp"
#include "memory/signal.hpp"
#include "memory/status_word.hpp"
#include "o80/base/error.hpp"

namespace o80 {

inline constexpr std::int64_t kShortestSlice = 100'000;  // of a wait that shows life [ns]

/// The error for a batch of `needed` blocks when only `free` of `most` may be used.
LaneFull lane_full(std::string_view segment, std::uint64_t needed, std::uint32_t free,
                   std::uint32_t most);

/// Move-only: a lane taken by a frontend; given back by the destructor, or by the kernel.
///
/// Ids and positions go on where former owners left them.
///
/// Writer:   its owner, which guards the sending calls (next_id, draw_ids, free_blocks, send) if it
/// has
///           several threads.
/// Readers:  the backend; statuses, bursts, messages and waits may be asked from any thread.
/// Realtime: send and the questions, yes; taking and waiting, no.
class LaneSender {
 public:
  enum class Known { not_yet, yes, forgotten };
  struct StatusAnswer {
    Known known;
    StatusWord word;  // if known == yes
  };
  struct BurstAnswer {
    Known known;
    Iteration row;  // of its last iteration, if known == yes
    BurstEnd end = BurstEnd::done;
  };

  /// Takes the first free lane of a segment attached with Access::read_write, which must outlive
  /// it. Throws NoLane (naming the holders), ReadOnly, UsedAfterFork.
  explicit LaneSender(const AttachedSegment& segment);
  LaneSender(LaneSender&& other) noexcept;
  LaneSender& operator=(LaneSender&&) = delete;
  ~LaneSender();

  /// Gives the lane back now; questions may still be asked, nothing may be sent.
  void give_back() noexcept;

  std::uint32_t lane() const noexcept { return lane_; }
  std::uint64_t incarnation() const noexcept { return incarnation_; }
  /// All blocks of the lane: the largest batch there can be.
  std::uint32_t blocks() const noexcept { return view_.shape.lane_blocks; }
  /// Blocks that may be sent now.
  std::uint32_t free_blocks() const noexcept;
  /// The lowest id that was never drawn, from 1.
  std::uint64_t next_id() const noexcept { return next_id_; }
  /// All ids below `next` are drawn. Ids never go back.
  void draw_ids(std::uint64_t next) noexcept;
  /// Ids whose status is remembered: each at its id modulo this.
  std::uint64_t statuses() const noexcept { return 2 * std::uint64_t{blocks()}; }
  /// Copies a whole batch of blocks, draws its ticket, writes it at `ticket_offset` (multiple of 8)
  /// of the first block, commits all with one store, rings. Returns the ticket.
  /// Throws LaneFull with nothing sent, InvalidArgument, UsedAfterFork.
  std::uint64_t send(std::span<const std::byte> batch, std::size_t ticket_offset);

  /// Asks for the burst of the batch `id` to end, after the iteration under way or before its
  /// first. From any thread; nothing happens once the lane is given back.
  void cancel_burst(std::uint64_t id) noexcept;

  StatusAnswer status(std::uint64_t id) const noexcept;
  /// The text that came with a status, if it is still there.
  std::optional<std::string> message(std::uint64_t id) const;
  /// Whether the burst of the batch `id` is done.
  BurstAnswer burst(std::uint64_t id) const noexcept;

  /// Tells the backend's watchdog that this frontend lives.
  void show_life() noexcept {
    // after it was given back the lane may be another's, the page is still writable
    if (!lock_.is_open()) return;
    page_->life.store(view_.counters().published.load(std::memory_order_relaxed),
                      std::memory_order_relaxed);
  }
  /// The backend has a watchdog: waits show life, at least this often [ns].
  void show_life_every(std::int64_t slice) noexcept {
    slice_ = std::clamp<std::int64_t>(slice, kShortestSlice, kSlice);
    watched_ = true;
  }

  /// Changes whenever the backend has news for this lane.
  std::uint32_t events() const noexcept {
    return feedback_->events.load(std::memory_order_acquire);  // sync events
  }
  /// Until `done()`, which is asked again whenever the backend has flagged the lane.
  /// `events_before_send` is the event count before the awaited batch was sent: `done` is not asked
  /// while the count stands there.
  /// Throws BackendGone (any of it) and Cancelled.
  template <class Done>
  Waited wait_until(Done&& done, const Deadline& deadline, const KeepWaiting& keep_waiting = {},
                    std::optional<std::uint32_t> events_before_send = {}) {
    std::int64_t look_at = 0;
    std::int64_t nap = slice_;  // what is left until then
    while (true) {
      if (watched_) show_life();
      const std::uint32_t seen = events();
      if (seen != events_before_send && done()) return Waited::ready;
      if (spinner_.spin([&] { return events() != seen; }) && done()) return Waited::ready;
      if (deadline.over()) {
        // a wait too short to look around learns of the end all the same
        const bool gone = segment_->gone();
        if (done()) return Waited::ready;
        if (gone) segment_->throw_if_gone();
        return Waited::timed_out;
      }
      if (look_at == 0) look_at = monotonic_now() + slice_;
      sleep(seen, deadline.left(nap));
      nap = look_at - monotonic_now();
      if (nap > 0 && !segment_->has_ended()) continue;
      look_at = monotonic_now() + slice_;
      nap = slice_;
      // what is done is done, whatever became of the backend
      const bool gone = look_around(keep_waiting);
      if (done()) return Waited::ready;
      if (gone) segment_->throw_if_gone();
    }
  }

 private:
  void count_in();
  /// So long [ns] at most.
  void sleep(std::uint32_t seen, std::int64_t at_most);
  /// True if the backend is gone. Throws Cancelled.
  bool look_around(const KeepWaiting& keep_waiting) const;

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
