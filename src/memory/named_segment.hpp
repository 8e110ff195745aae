#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "memory/file_lock.hpp"

namespace o80 {

/// Move-only: the two files behind the name of a segment, for whoever replaces or removes them.
///
/// Byte 0 of the commanders' file decides: its holder is the living backend, or the only process
/// that may take the name away. A file without a commanders' file (of another version of o80, made
/// by something else, damaged) is decided by its own byte 0.
class NamedSegment {
 public:
  /// Not open, with errno set, if the segment file cannot be opened.
  static NamedSegment open(std::string_view name);

  bool is_open() const noexcept { return file_.is_open(); }
  /// Of the segment file; bears no lock if there is a commanders' file.
  int descriptor() const noexcept { return file_.descriptor(); }
  const std::string& path() const noexcept { return path_; }
  const std::string& commands_path() const noexcept { return commands_path_; }
  /// False if this user may not open the deciding file for writing: then nothing can be locked.
  bool can_lock() const noexcept { return can_lock_; }
  /// Throws SegmentError if the owner of the file is not trusted (file_owner.hpp).
  void check_owner() const;
  /// True if the deciding byte is now ours. To be followed by `is_current`.
  bool try_lock() noexcept;
  /// True if the name still leads to this segment file.
  bool is_current() const noexcept;
  /// True if a living backend has the name. Waits a moment for processes that hold the byte in
  /// passing: a cleaner, a starter, a dying process. To be asked only if the byte is not ours.
  bool is_alive() const;
  /// What refuses a second backend.
  std::string taken_text() const;
  /// Unlinks both files, the segment file first: no name ever leads to a segment whose commanders'
  /// file is missing. False if the name could not be removed. The byte must be ours.
  bool remove() noexcept;
  /// After the name was given to another segment. The byte must be ours.
  void remove_commands() noexcept;

 private:
  const LockFile& deciding() const noexcept { return commands_.is_open() ? commands_ : file_; }

  std::string name_;
  std::string path_;
  std::string commands_path_;  // empty if there is none
  LockFile file_;
  LockFile commands_;
  bool can_lock_ = false;
};

/// Removes what starters, cleaners and backends left behind when they were killed: segment files
/// that were never complete, commanders' files without their segment.
void sweep_orphans();

}  // namespace o80
