#pragma once

#include <cstdint>
#include <optional>

#include "memory/os/spinner.hpp"
#include "memory/segment/attached_segment.hpp"
#include "o80/base/time.hpp"

namespace o80 {

// longest sleep between two checks of the backend and of KeepWaiting [ns]
inline constexpr std::int64_t kSlice = 50'000'000;

enum class Waited { ready, timed_out };

/// Registers for the wake-up of row k; the value of `row_wake` to sleep on, or nothing if there is
/// nothing to wait for: the row is there, or the backend has ended. Needs Access::read_write.
std::optional<std::uint32_t> register_for_row(const AttachedSegment& segment, Iteration k) noexcept;
/// After a sleep on `seen`: the writer woke one, and the first awake wakes the rest.
void pass_on_wake(const SegmentView& view, std::uint32_t seen) noexcept;

/// Waits for rows (src/memory/README.md#waiting).
///
/// A waiter spins, lowers the word `wanted`, checks `published` again, and sleeps. The writer
/// resets `wanted` when that row is published and wakes one waiter, which wakes the others. A
/// read-only waiter polls.
///
/// If the row is known to come later, a waiter does not spin; on the loop's processor it sleeps by
/// the clock until then, because a loop that wakes a thread there is preempted by it.
///
/// Writer:   RowSignal.
/// Readers:  any threads.
/// Realtime: no.
class RowWaiter {
 public:
  explicit RowWaiter(const AttachedSegment& segment) noexcept
      : segment_(&segment), view_(segment.view()) {}

  /// Waits until row k is published. Throws BackendGone (any kind) and Cancelled.
  Waited wait_for_row(Iteration k, const Deadline& deadline, const KeepWaiting& keep_waiting = {});

 private:
  /// Time until row k is expected [ns]; 0 if that is past, or unknown.
  std::int64_t time_until(Iteration k) const noexcept;
  void sleep(Iteration k, std::int64_t at_most) noexcept;
  void poll(Iteration k, std::int64_t at_most) noexcept;

  const AttachedSegment* segment_;
  SegmentView view_;
  Spinner spinner_;
};

/// Decides whether a thread that waits for a row must be woken; wake_sleepers() wakes it.
///
/// Writer:   the backend's thread, after HistoryWriter::publish.
/// Readers:  RowWaiter.
/// Realtime: yes; one load if no thread waits.
class RowSignal {
 public:
  explicit RowSignal(const SegmentView& view) noexcept : view_(view) {}
  /// True if a thread waits for row k or an older one. The caller then wakes one on `row_wake`.
  bool announce(Iteration k) noexcept;
  /// Stores when the next row is expected: as long after `due` as this one after `due - period`.
  /// For a loop that the clock paces, after each row and before announce().
  void expect_next(std::int64_t due, std::int64_t period) noexcept;

 private:
  SegmentView view_;
  std::int64_t delay_ = 0;  // of the last row after its due time [ns]
};

/// Blocks the backend until a frontend has committed a batch.
///
/// Writer:   ring_bell, from any thread or signal handler.
/// Readers:  the backend's thread.
/// Realtime: no, unless the bell has rung already.
class BellWaiter {
 public:
  explicit BellWaiter(const SegmentView& view) noexcept : view_(view) {}
  std::uint32_t value() const noexcept;
  /// Waits until the bell is no longer `seen`, at most `at_most` [ns] and at most kSlice; true if
  /// it has rung.
  bool wait(std::uint32_t seen, std::int64_t at_most = kSlice) noexcept;

 private:
  SegmentView view_;
  Spinner spinner_;
};

/// The sleeping threads to wake.
struct Sleepers {
  bool lanes = false;  // result of LaneReceivers::announce(): all that wait on a lane
  bool rows = false;   // result of RowSignal::announce(): one that waits for a row
};

/// Wakes them with at most one system call.
///
/// Realtime: yes.
void wake_sleepers(const SegmentView& view, Sleepers sleepers) noexcept;

/// Rings the bell: a batch is committed, a halt requested, or the backend is to stop. A system call
/// only if it sleeps.
void ring_bell(const SegmentView& view) noexcept;

}  // namespace o80
