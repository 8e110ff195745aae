#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "o80/base/time.hpp"
#include "o80/memory/file_lock.hpp"
#include "o80/memory/fork.hpp"
#include "o80/memory/mapping.hpp"
#include "o80/memory/segment_layout.hpp"

namespace o80 {

/// What the backend says of itself (superseded is said by its successor).
enum class State : std::uint32_t { starting, running, stopped, failed, superseded };

/// What is true of it: the word above and the kernel's lock together.
enum class Life { starting, running, stopped, failed, superseded, killed };
const char* name_of(Life life) noexcept;

/// Asked now and then in every wait; false ends the wait with Cancelled. Empty: never asked.
using Check = std::function<bool()>;

struct SegmentSpec {
  std::string name;
  std::span<const std::byte> schema;
  std::uint32_t row_bytes = 0;        // multiple of 8
  std::uint64_t rows = 1;             // history promised
  std::uint32_t lanes = 8;            // commanding frontends at once
  std::uint32_t lane_blocks = 16384;  // of 64 bytes, rounded up to a power of two
  mode_t permission = 0600;
};

/// Move-only: the segment of a living backend.
///
/// Writer:   the backend, one thread.
/// Readers:  every attached process.
/// Realtime: view() and state only; creation and end are not.
class OwnedSegment {
 public:
  /// Builds the file, holds it, gives it its name; a dead one of that name is taken over.
  /// Throws SegmentTaken, SegmentError, InvalidArgument.
  static OwnedSegment create(const SegmentSpec& spec);
  /// Throws SegmentTaken if a living backend has the name: to ask before hardware is touched.
  static void refuse_if_taken(std::string_view name);

  OwnedSegment(OwnedSegment&&) noexcept = default;
  OwnedSegment& operator=(OwnedSegment&& other) noexcept;
  /// Ends as stopped unless it has ended, and lets go of the name. The file goes too, unless it
  /// failed: then it stays, so that whoever comes to attach learns why.
  ~OwnedSegment();

  const std::string& name() const noexcept { return name_; }
  std::uint64_t epoch() const noexcept { return epoch_; }
  const SegmentView& view() const noexcept { return view_; }
  /// A descriptor of the file that bears no locks.
  int descriptor() const noexcept { return query_.descriptor(); }
  State state() const noexcept;
  /// starting => running.
  void set_state(State state) noexcept;
  /// Says why and wakes everybody who waits for a row or on a lane.
  void end(State stopped_or_failed, std::string_view text = {}) noexcept;
  /// Unlinks the file if the name still leads to it.
  void remove() noexcept;
  /// Throws UsedAfterFork.
  void check_process() const;

 private:
  OwnedSegment() = default;

  std::string name_;
  std::uint64_t epoch_ = 0;
  LockFile lock_;   // holds byte 0, never mapped
  LockFile query_;  // the mapped one, holds nothing
  Mapping mapping_;
  SegmentView view_;
  ForkGuard guard_;
};

enum class Access { read_only, read_write };

struct AttachOptions {
  enum class Dead { wait, accept };
  Dead dead = Dead::wait;          // accept: also a stopped, failed or killed one, to read it
  std::uint64_t ignore_epoch = 0;  // a segment of this epoch counts as not there
  Check check;
};

/// Move-only: the segment of some backend, seen from a frontend.
///
/// Mapped read-only but for the bell (with Access::read_write) and the lane that a LaneSender
/// takes. Copies its header first: what the file says later moves no bound.
///
/// Writer / Readers: const calls from any thread.
/// Realtime: view() only.
class AttachedSegment {
 public:
  /// Waits until a segment of that name is running. Throws TimeoutError (listing what there is),
  /// SegmentError, BackendFailed, Cancelled, InvalidArgument.
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
  int descriptor() const noexcept { return file_.descriptor(); }
  /// Asks the kernel: 2 us unless the state word says enough.
  Life life() const noexcept;
  std::string fault() const;
  /// Throws the fitting BackendGone unless starting or running; UsedAfterFork.
  void throw_if_gone() const;
  /// The same, asking the kernel at most every 20 ms: a clock read otherwise.
  void throw_if_known_gone() const;
  /// Throws UsedAfterFork.
  void check_process() const;
  /// Another open file of the same segment, for the lock of a lane.
  LockFile open_again() const;

 private:
  AttachedSegment() = default;
  friend class SegmentOpener;

  std::string name_;
  Access access_ = Access::read_only;
  SegmentHeader header_{};
  LockFile file_;  // the mapped one, holds nothing
  Mapping mapping_;
  SegmentView view_;
  ForkGuard guard_;
  mutable std::atomic<std::int64_t> asked_{0};
};

struct SegmentEntry {
  std::string name;
  Life life;      // killed: nobody holds it
  bool readable;  // false: not a segment of this version, or not ours to read
  int pid;
  std::int64_t started_at;  // [s] since 1970
  std::string user, program;
  std::uint64_t epoch;
  std::uint64_t bytes;
};

/// All segments of the directory, by name.
std::vector<SegmentEntry> list_segments();

/// Removes a dead segment; false if there is none. Throws SegmentTaken if it is alive.
bool clean(std::string_view name);

/// Removes all dead segments and the temporary files nobody holds; the names removed.
std::vector<std::string> clean_dead();

/// "pid 4711, started 14:02 by ada".
std::string describe_owner(const SegmentHeader& header);

}  // namespace o80
