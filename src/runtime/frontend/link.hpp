#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "control/batch/command_check.hpp"
#include "control/sending/batch_builder.hpp"
#include "memory/ring/history.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segment/attached_segment.hpp"
#include "memory/segment/halt_word.hpp"
#include "memory/segment/signal.hpp"
#include "o80/runtime/observation.hpp"
#include "runtime/frontend/ids_in_flight.hpp"
#include "runtime/frontend/sent_commands.hpp"
#include "runtime/protocol/inline_runner.hpp"

namespace o80 {

/// Number of blocks in a lane that commands must leave free, so that a burst, a purge or a request
/// can still be sent.
constexpr std::uint32_t kept_free(std::uint32_t blocks) noexcept {
  return blocks < 8 ? 0 : std::clamp(blocks / 16, 2U, 16U);
}

/// True if the rows of a segment come from a recording (runtime/replay/played_segment.hpp).
inline bool is_played(const AttachedSegment& segment) noexcept {
  return (segment.header().flags & kPlayed) != 0;
}
/// Throws ReadOnly if they do: nobody takes commands there.
void refuse_if_played(const AttachedSegment& segment);

/// State shared by a frontend, its batches and its bursts: the attached segment and the lane.
///
/// Writer / Readers: any threads; `sending` guards what is sent.
struct Link {
  Link(AttachedSegment attached, std::shared_ptr<InlineRunner> inline_runner);

  /// The lane of this frontend, acquired at the first call. Throws NoLane, ReadOnly, Closed.
  std::shared_ptr<LaneSender> lane();
  /// The lane if this frontend has one, else null.
  std::shared_ptr<LaneSender> lane_if_taken() const;
  /// Throws Closed or UsedAfterFork.
  void check_usable() const;
  /// Locks `sending` to add or send something. Throws Closed, or UsedAfterFork: the mutex of a
  /// forked child may be held by a thread that exists in the parent only.
  std::unique_lock<std::mutex> lock_to_send() const;
  /// The same, to add a record. Throws ReadOnly if the segment is played from a recording.
  std::unique_lock<std::mutex> lock_to_add() const;
  /// True if a command of this frontend may have ended the command `id` as overwritten in
  /// `iteration`.
  bool has_replaced(CommandId id, Iteration iteration, std::span<const SentCommand> command) const;
  /// The halt in force. A frontend with write access also sees a halt that was requested and is not
  /// yet in force.
  std::optional<Halt> halt() const;
  /// Describes the halt that ended a command or burst in `iteration`: "it is halted since iteration
  /// 7 (halt 3, cause frontend, requested by pid 5 (python)): why". Empty if it is no longer in
  /// force.
  std::string halt_text(Iteration iteration) const;
  /// The process that owns a lane: "the frontend of pid 5 (python)".
  std::string owner_of(std::uint32_t lane) const;
  /// "most of the queue is of the frontend of pid 5 (python)..."; empty if no batch
  /// waits.
  std::string queue_text() const;
  /// `keep_waiting`, extended to throw Closed when the frontend is closed during a wait.
  KeepWaiting guarded(const KeepWaiting& keep_waiting) const;

  /// As UntypedFrontend::iteration_at.
  Iteration iteration_at(std::int64_t time) const;
  SegmentError damaged() const;
  std::optional<Seen> with_newest_row(const std::optional<Seen>& seen) const;

  AttachedSegment segment;
  std::shared_ptr<const Description> description;
  CommandCheck command_check;
  HistoryReader history;
  RowWaiter rows;
  std::shared_ptr<InlineRunner> runner;       // guarded by `sending`; null after close
  BatchBuilder builder;                       // records for the next pulse; guarded by `sending`
  std::vector<BatchBuilder::Member> members;  // of the group being added; guarded by `sending`
  IdsInFlight ids;                            // guarded by `sending`
  SentCommands sent_commands;                 // guarded by `sending`
  /// A batch sent for a later iteration.
  struct Scheduled {
    Iteration at;
    CommandId id;
  };
  std::deque<Scheduled> scheduled;  // guarded by `sending`; may hold batches already taken
  mutable std::mutex sending;
  std::uint32_t control_blocks = 0;  // guarded by `controlling`: runtime/frontend/control_block.hpp
  std::recursive_mutex controlling;  // locked before `sending`
  std::atomic<bool> closed{false};

 private:
  friend class UntypedFrontend;
  std::shared_ptr<LaneSender> lane_;
};

}  // namespace o80
