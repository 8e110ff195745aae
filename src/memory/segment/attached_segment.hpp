#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "memory/os/file_lock.hpp"
#include "memory/os/fork.hpp"
#include "memory/os/mapping.hpp"
#include "memory/segment/segment_layout.hpp"
#include "o80/base/keep_waiting.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/access.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

class OwnedSegment;

struct AttachOptions {
  bool dead = false;      // also attach to the segment of an ended backend
  bool starting = false;  // also attach to a backend without row 0
  KeepWaiting keep_waiting = {};
};

/// Move-only: the segment of a backend, as a frontend uses it.
///
/// Access::read_only opens the segment file only, Access::read_write the commanders' file too. All
/// is mapped read-only, except the bell and the lane that a LaneSender acquires. The header is
/// copied first, so later changes of the file cannot change any bound.
///
/// Writer / Readers: const calls from any thread.
/// Realtime: view() only.
class AttachedSegment {
 public:
  /// Waits until a segment of that name is running. Throws TimeoutError (with the known segments),
  /// SegmentError, ReadOnly (this user may not command), BackendFailed, Cancelled,
  /// InvalidArgument.
  static AttachedSegment attach(std::string_view name, Access access, const Deadline& deadline,
                                const AttachOptions& options = {});

  /// Attaches to a segment of this process, with Access::read_write; it needs no name. Throws
  /// SegmentError.
  static AttachedSegment attach(const OwnedSegment& owner);

  AttachedSegment(AttachedSegment&& other) noexcept;
  AttachedSegment& operator=(AttachedSegment&& other) noexcept;

  const std::string& name() const noexcept { return name_; }
  std::uint64_t epoch() const noexcept { return header_.epoch; }
  const SegmentHeader& header() const noexcept { return header_; }
  Access access() const noexcept { return access_; }
  /// The schema, from the mapping.
  std::span<const std::byte> schema() const noexcept;
  /// How the backend was started, from the mapping (runtime/journal/provenance_bytes.hpp).
  std::span<const std::byte> provenance() const noexcept;
  const SegmentView& view() const noexcept { return view_; }
  /// Descriptor of the segment file.
  int descriptor() const noexcept { return file_.descriptor(); }
  /// Descriptor of the commanders' file, without a lock; -1 with Access::read_only.
  int commands_descriptor() const noexcept { return commands_.descriptor(); }
  /// Queries the lock of the backend (2 us). An end is final: during a take-over the successor
  /// holds the lock of the dead backend for a moment, which does not make it running again
  /// (src/memory/README.md#successor).
  Life life() const noexcept;
  /// True if the stored state is an end: one load. Does not detect a killed backend.
  bool has_ended() const noexcept;
  /// True if the backend has ended or was killed; queries its lock, as life() does.
  bool gone() const noexcept;
  std::string fault() const;
  /// Throws the matching kind of BackendGone if the backend has ended; UsedAfterFork.
  void throw_if_gone() const;
  /// The same, but queries the lock at most every 20 ms; in between it reads a clock only.
  void throw_if_known_gone() const;
  /// Throws UsedAfterFork.
  void check_process() const;
  bool forked() const noexcept { return guard_.forked(); }
  /// Opens the commanders' file once more, for the lock of a lane.
  LockFile open_commands_again() const;

 private:
  AttachedSegment() = default;
  void throw_gone(Life life) const;
  /// Empty, with a `reason`, if there is no such segment now. Throws SegmentError, ReadOnly.
  static std::optional<AttachedSegment> open(std::string_view name, Access access,
                                             std::string& reason);
  bool open_commands(std::string& reason);
  void map();
  void map_commands();

  std::string name_;
  std::string path_;
  Access access_ = Access::read_only;
  mutable std::atomic<std::uint32_t> over_{0};  // the Life with which it ended; 0 until then
  SegmentHeader header_{};
  LockFile file_;      // mapped, without a lock
  LockFile commands_;  // mapped, without a lock; not open with Access::read_only
  Mapping mapping_;
  Mapping commands_mapping_;
  SegmentView view_;
  ForkGuard guard_;
  mutable std::atomic<std::int64_t> queried_{0};  // time of the last query of the lock [ns]
};

}  // namespace o80
