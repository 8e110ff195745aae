#pragma once

#include <cstdint>
#include <optional>

#include "memory/attached_segment.hpp"
#include "memory/spinner.hpp"
#include "o80/base/time.hpp"

namespace o80 {

inline constexpr std::int64_t kSlice = 50'000'000;  // longest sleep without a look around [ns]

enum class Waited { ready, timed_out };

/// Registers for the wake-up of row k; the value of `row_wake` to sleep on, or nothing if there is
/// nothing to wait for: the row is there, or the backend has ended. Needs Access::read_write.
std::optional<std::uint32_t> register_for_row(const AttachedSegment& segment, Iteration k) noexcept;
/// After a sleep on `seen`: the writer woke one, and the first awake tells the rest.
void pass_on_wake(const SegmentView& view, std::uint32_t seen) noexcept;

/// Waits for rows.
///
/// A waiter lowers the word `wanted`, looks again, sleeps; the writer resets it when it is reached
/// and wakes one; the first awake wakes the rest. A read-only waiter polls.
///
/// Writer:   RowSignal.
/// Readers:  any threads.
/// Realtime: no, it waits.
class RowWaiter {
 public:
  /// `poll` is how often a read-only waiter looks [ns].
  explicit RowWaiter(const AttachedSegment& segment, std::int64_t poll = 1'000'000) noexcept;

  /// Until row k is published. Throws BackendGone (any of it) and Cancelled.
  Waited wait_for_row(Iteration k, const Deadline& deadline, const KeepWaiting& keep_waiting = {});

 private:
  void sleep(Iteration k, std::int64_t at_most) noexcept;
  void poll(Iteration k, std::int64_t at_most) noexcept;

  const AttachedSegment* segment_;
  SegmentView view_;
  std::int64_t poll_;
  Spinner spinner_;
};

/// Knows who waits for rows; `wake_sleepers` wakes them.
///
/// Writer:   the backend's thread, after HistoryWriter::publish.
/// Readers:  RowWaiter.
/// Realtime: yes; one load when nobody waits.
class RowSignal {
 public:
  explicit RowSignal(const SegmentView& view) noexcept : view_(view) {}
  /// True if one of those who sleep on `row_wake` is to be woken.
  bool announce(Iteration k) noexcept;

 private:
  SegmentView view_;
};

/// The backend's ear: waits until a frontend has committed something.
///
/// Writer:   every LaneSender; `interrupt` from any thread or signal handler of the backend.
/// Readers:  the backend's thread.
/// Realtime: yes while it rings; else it waits.
class BellWaiter {
 public:
  explicit BellWaiter(const SegmentView& view) noexcept : view_(view) {}
  std::uint32_t value() const noexcept;
  /// Until the bell is no longer `seen`, at most `at_most` [ns], cut to kSlice; true if it rang.
  bool wait(std::uint32_t seen, std::int64_t at_most = kSlice) noexcept;
  /// Rings it for the backend's own sake (stop).
  void interrupt() noexcept;

 private:
  SegmentView view_;
  Spinner spinner_;
};

/// Which of those who sleep are to be woken.
struct Sleepers {
  bool lanes = false;  // what LaneReceivers::announce said: all that wait with a lane
  bool rows = false;   // what RowSignal::announce said: one that waits for a row
};

/// Wakes them with one system call at most.
///
/// Realtime: yes.
void wake_sleepers(const SegmentView& view, Sleepers sleepers) noexcept;

/// Rings the bell; a system call only if the backend sleeps.
void ring_bell(const SegmentView& view) noexcept;

}  // namespace o80
