#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "memory/ring/history.hpp"
#include "memory/ring/journal.hpp"
#include "memory/segment/halt_word.hpp"
#include "memory/segment/owned_segment.hpp"
#include "memory/segment/signal.hpp"
#include "o80/base/keep_waiting.hpp"
#include "o80/describe/layout.hpp"
#include "o80/describe/schema.hpp"
#include "o80/runtime/provenance.hpp"
#include "runtime/backend/burst_server.hpp"

namespace o80 {

struct PlayedOptions {
  std::string segment;
  std::span<const std::byte> description;  // of the recorded robot, as its segment had it
  Provenance provenance{};                 // of the recorded robot; its clock is that of the rows
  bool bursting = false;                   // rows are published when frontends request iterations
  Clock clock = Clock::simulated;          // that of the times in the rows
  std::uint64_t history = 1;               // rows kept
  bool journal = false;                    // add_journal() will be called
  mode_t permission = 0600;                // read: may observe; write: may request bursts
};

/// The segment of a robot whose recorded rows are published again. To its readers it is a backend
/// like any other; commands, requests and halts are refused.
///
/// Move-only.
///
/// Writer:   one thread; ask_to_stop() any.
/// Readers:  frontends in any process.
/// Realtime: no.
class PlayedSegment {
 public:
  /// Takes the name. Throws SegmentTaken if a living backend has it, or if it leads to what a robot
  /// that failed or was killed has left; SegmentError for an invalid description.
  explicit PlayedSegment(const PlayedOptions& options);
  PlayedSegment& operator=(PlayedSegment&&) = delete;
  /// Ends as stopped unless it has ended.
  ~PlayedSegment();

  std::size_t row_bytes() const noexcept { return layout_.size; }
  /// Adds entries of the recorded journal, which are written before the rows of their iterations;
  /// returns the iteration of the last one. `codec`: version of their format. Throws
  /// InvalidArgument if it is newer than this o80, or if they are damaged.
  Iteration add_journal(std::span<const std::byte> entries, std::int64_t codec);
  /// Publishes rows, each when the monotonic clock reaches its `due` [ns] (late ones at once; no
  /// `due`: all at once), and returns their number: fewer after ask_to_stop() or if `keep_waiting`
  /// returned false. Iterations must grow; those between are shown as missing.
  /// Throws InvalidArgument for rows in another order.
  std::size_t publish(std::span<const std::byte> rows, std::span<const std::int64_t> due,
                      const KeepWaiting& keep_waiting = {});
  /// The same as frontends request iterations. The first row of all is published at once.
  std::size_t serve(std::span<const std::byte> rows, const KeepWaiting& keep_waiting = {});
  /// After the last row: waits until a frontend requests another iteration. False after
  /// ask_to_stop() or if `keep_waiting` returned false.
  bool wait_for_burst(const KeepWaiting& keep_waiting = {});
  /// Ends it as the journal says that the recorded robot ended, else as stopped.
  void end();
  /// Makes publish() and serve() return within 50 ms.
  void ask_to_stop() noexcept;

 private:
  const std::byte* row(std::span<const std::byte> rows, std::size_t i) const;
  std::size_t count(std::span<const std::byte> rows) const;
  bool wait_until(std::int64_t due, const KeepWaiting& keep_waiting);
  /// True if a reader must be woken.
  bool publish_one(const std::byte* row);
  /// Writes the added entries up to this iteration into the journal, with their numbers.
  void write_journal(Iteration k);
  void note(const JournalItem& item);
  void show_halt(Iteration k, bool halted);

  RowLayout layout_;
  OwnedSegment segment_;
  HistoryWriter history_;
  RowSignal signal_;
  HaltLatch halts_;
  JournalWriter journal_;
  std::deque<JournalItem> added_;  // and not written
  Halt recorded_halt_;  // the newest one that was written; its number is 0 if there is none
  /// How the recorded backend ended, with the fault of a failed one.
  std::pair<BackendState, std::string> recorded_end_{BackendState::stopped, {}};
  std::unique_ptr<BurstServer> bursts_;  // null unless bursting
  std::vector<std::uint64_t> row_;       // the row being published
  Iteration last_ = -1;
  std::atomic<bool> stop_{false};
};

}  // namespace o80
