#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "memory/os/file_lock.hpp"
#include "memory/os/fork.hpp"
#include "memory/os/mapping.hpp"
#include "memory/segment/anonymous_file.hpp"
#include "memory/segment/name_socket.hpp"
#include "memory/segment/segment_file.hpp"
#include "memory/segment/segment_layout.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

struct SegmentSpec {
  std::string name;
  std::span<const std::byte> schema;
  std::span<const std::byte> provenance{};  // at most 16 MiB
  std::uint32_t row_bytes = 0;              // multiple of 8
  std::uint64_t rows = 1;                   // length of the history
  std::uint32_t lanes = 8;                  // most frontends that command at the same time
  std::uint32_t lane_blocks = 16384;  // 64-byte blocks of a lane, rounded up to a power of two
  std::uint64_t journal_bytes = 0;    // rounded up to a power of two; 0: no journal
  mode_t permission = 0600;           // read: may observe; write: may command
  /// Starts halted if the replaced segment was halted, or if its backend died while commands were
  /// active.
  bool inherits_halt = false;
  /// The files get no name until OwnedSegment::publish(); `name` is for messages only.
  bool anonymous = false;
  bool played = false;  // a recording is played into it: its frontends send no command
};

/// Move-only: the segment of a living backend.
///
/// Writer:   the backend, one thread.
/// Readers:  every attached process.
/// Realtime: view() and state only; creation and end are not.
class OwnedSegment {
 public:
  /// Creates and locks both files and gives the segment its name, which it takes over from the
  /// segment of a dead backend. Throws SegmentTaken, SegmentError, InvalidArgument.
  static OwnedSegment create(const SegmentSpec& spec);
  /// Throws SegmentTaken if a living backend has the name, SegmentError if the file of a user
  /// without trust has it. Call it before the hardware is touched.
  static void refuse_if_taken(std::string_view name);
  /// Gives an anonymous segment a name, so that other processes can attach. name() keeps its value.
  /// Throws as create(), and Error if the segment has a name already.
  void publish(const std::string& name);

  OwnedSegment(OwnedSegment&&) noexcept = default;
  OwnedSegment& operator=(OwnedSegment&&) = delete;
  /// Ends as stopped unless it has ended, and removes the files. The files of a failed backend
  /// stay, so that a later attach can report the reason.
  ~OwnedSegment();

  const std::string& name() const noexcept { return name_; }
  std::uint64_t epoch() const noexcept { return epoch_; }
  const SegmentView& view() const noexcept { return view_; }
  /// A descriptor of the commanders' file without a lock.
  int commands_descriptor() const noexcept { return query_.descriptor(); }
  /// Opens a file once more, for a frontend in this process.
  LockFile open_segment_again(int flags) const { return open_again(lock_, flags); }
  LockFile open_commands_again(int flags) const { return open_again(query_, flags); }
  const NameSocket& socket() const noexcept { return socket_; }
  /// The names of both files; empty while it is anonymous.
  FileNames names() const;
  BackendState state() const noexcept;
  /// Stores the state, from starting to running.
  void set_state(BackendState state) noexcept;
  /// Stores the end and its reason, and wakes all threads that wait for a row or on a lane.
  void end(BackendState stopped_or_failed, std::string_view text = {}) noexcept;
  /// Ends as stopped unless it has ended, and removes the files, also those of a failed backend.
  void end_and_remove() noexcept;
  /// Unlinks both files; the segment file only if the name still leads to it.
  void remove() noexcept;
  /// Throws UsedAfterFork.
  void check_process() const;

 private:
  OwnedSegment() = default;

  void end_if_alive() noexcept;

  std::string name_;
  std::string path_;           // empty while it is anonymous
  std::string commands_path_;  // empty while it is anonymous
  std::uint64_t epoch_ = 0;
  // in this order, because the deciding lock is released last
  LockFile commands_lock_;  // the commanders' file: holds the lock of byte 0, not mapped
  LockFile lock_;           // the segment file: holds the lock of byte 0, not mapped
  NameSocket socket_;
  LockFile query_;  // the commanders' file: mapped, without a lock
  Mapping commands_mapping_;
  Mapping mapping_;
  SegmentView view_;
  ForkGuard guard_;
};

}  // namespace o80
