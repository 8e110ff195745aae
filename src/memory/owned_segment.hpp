#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "memory/file_lock.hpp"
#include "memory/fork.hpp"
#include "memory/mapping.hpp"
#include "memory/segment_layout.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

struct SegmentSpec {
  std::string name;
  std::span<const std::byte> schema;
  std::uint32_t row_bytes = 0;        // multiple of 8
  std::uint64_t rows = 1;             // history promised
  std::uint32_t lanes = 8;            // commanding frontends at once
  std::uint32_t lane_blocks = 16384;  // of 64 bytes, rounded up to a power of two
  mode_t permission = 0600;           // read: may observe; write: may command
  /// Begins halted if it replaces a segment that was, or one whose backend died while commands
  /// acted.
  bool inherits_halt = false;
};

/// Move-only: the segment of a living backend.
///
/// Writer:   the backend, one thread.
/// Readers:  every attached process.
/// Realtime: view() and state only; creation and end are not.
class OwnedSegment {
 public:
  /// Builds both files, locks them, gives the segment its name; a dead one of that name is taken
  /// over.
  /// Throws SegmentTaken, SegmentError, InvalidArgument.
  static OwnedSegment create(const SegmentSpec& spec);
  /// Throws SegmentTaken if a living backend has the name, SegmentError if somebody else's file
  /// has it: to ask before hardware is touched.
  static void refuse_if_taken(std::string_view name);

  OwnedSegment(OwnedSegment&&) noexcept = default;
  OwnedSegment& operator=(OwnedSegment&& other) noexcept;
  /// Ends as stopped unless it has ended, and gives up the name. The files are removed, unless it
  /// failed: then they stay, so that frontends that attach later learn why.
  ~OwnedSegment();

  const std::string& name() const noexcept { return name_; }
  std::uint64_t epoch() const noexcept { return epoch_; }
  const SegmentView& view() const noexcept { return view_; }
  /// A descriptor of the commanders' file that bears no locks.
  int commands_descriptor() const noexcept { return query_.descriptor(); }
  BackendState state() const noexcept;
  /// starting => running.
  void set_state(BackendState state) noexcept;
  /// Says why and wakes everybody who waits for a row or on a lane.
  void end(BackendState stopped_or_failed, std::string_view text = {}) noexcept;
  /// Unlinks both files; the segment file only if the name still leads to it.
  void remove() noexcept;
  /// Throws UsedAfterFork.
  void check_process() const;

 private:
  OwnedSegment() = default;

  void release() noexcept;

  std::string name_;
  std::string path_;
  std::string commands_path_;
  std::uint64_t epoch_ = 0;
  LockFile lock_;           // of the segment file: holds byte 0, never mapped
  LockFile commands_lock_;  // the same of the commanders' file
  LockFile query_;          // the mapped commanders' file, holds nothing
  Mapping mapping_;
  Mapping commands_mapping_;
  SegmentView view_;
  ForkGuard guard_;
};

}  // namespace o80
