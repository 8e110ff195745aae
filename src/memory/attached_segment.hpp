#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "memory/file_lock.hpp"
#include "memory/fork.hpp"
#include "memory/mapping.hpp"
#include "memory/segment_layout.hpp"
#include "o80/base/keep_waiting.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/access.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

struct AttachOptions {
  enum class Dead { wait, accept };
  Dead dead = Dead::wait;          // accept: also a stopped, failed or killed one, to read it
  bool starting = false;           // also one that has not published row 0 yet
  std::uint64_t ignore_epoch = 0;  // a segment of this epoch counts as not there
  KeepWaiting keep_waiting = {};
};

/// Move-only: the segment of some backend, seen from a frontend.
///
/// With Access::read_only it opens the segment file alone; with Access::read_write the commanders'
/// file too. Mapped read-only but for the bell and the lane that a LaneSender takes. Copies the
/// header first: what the file says later moves no bound.
///
/// Writer / Readers: const calls from any thread.
/// Realtime: view() only.
class AttachedSegment {
 public:
  /// Waits until a segment of that name is running. Throws TimeoutError (listing what there is),
  /// SegmentError, ReadOnly (this user may not command), BackendFailed, Cancelled,
  /// InvalidArgument.
  static AttachedSegment attach(std::string_view name, Access access, const Deadline& deadline,
                                const AttachOptions& options = {});

  AttachedSegment(AttachedSegment&& other) noexcept;
  AttachedSegment& operator=(AttachedSegment&& other) noexcept;

  const std::string& name() const noexcept { return name_; }
  std::uint64_t epoch() const noexcept { return header_.epoch; }
  const SegmentHeader& header() const noexcept { return header_; }
  Access access() const noexcept { return access_; }
  /// The schema, from the mapping.
  std::span<const std::byte> schema() const noexcept;
  const SegmentView& view() const noexcept { return view_; }
  /// Of the segment file.
  int descriptor() const noexcept { return file_.descriptor(); }
  /// Of the commanders' file, which bears no lock of ours; -1 with Access::read_only.
  int commands_descriptor() const noexcept { return commands_.descriptor(); }
  /// Asks the kernel: 2 us. Once over, never starting or running again, although its successor
  /// holds the lock of the dead for a moment before it says so.
  Life life() const noexcept;
  /// Whether the backend, or its successor, has said that it is over: one load.
  bool has_ended() const noexcept;
  /// Neither starting nor running, for good.
  bool gone() const noexcept;
  std::string fault() const;
  /// Throws the fitting BackendGone unless starting or running; UsedAfterFork.
  void throw_if_gone() const;
  /// The same, asking the kernel at most every 20 ms: a clock read otherwise.
  void throw_if_known_gone() const;
  /// Throws UsedAfterFork.
  void check_process() const;
  bool forked() const noexcept { return guard_.forked(); }
  /// Another open file of the same commanders' file, for the lock of a lane.
  LockFile open_commands_again() const;

 private:
  AttachedSegment() = default;
  friend class SegmentSearch;
  void throw_gone(Life life) const;
  /// Nothing if it is not there, or not any more, and `reason` says so. Throws SegmentError,
  /// ReadOnly.
  static std::optional<AttachedSegment> open(std::string_view name, Access access,
                                             std::string& reason);
  bool open_commands(std::string& reason);
  void map_commands();

  std::string name_;
  std::string path_;
  Access access_ = Access::read_only;
  mutable std::atomic<std::uint32_t> over_{0};  // a Life: how it ended, as seen so far
  SegmentHeader header_{};
  LockFile file_;      // mapped, holds nothing
  LockFile commands_;  // the same; not open with Access::read_only
  Mapping mapping_;
  Mapping commands_mapping_;
  SegmentView view_;
  ForkGuard guard_;
  mutable std::atomic<std::int64_t> asked_{0};
};

}  // namespace o80
