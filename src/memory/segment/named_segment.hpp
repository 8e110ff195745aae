#pragma once

#include <string>
#include <string_view>

#include "memory/os/file_lock.hpp"

namespace o80 {

/// Move-only: the two files behind the name of a segment, to replace or remove them
/// (src/memory/README.md#successor).
///
/// The lock of byte 0 of the commanders' file decides: its holder is the living backend, or the
/// only process that may replace or remove the segment. For a file without a commanders' file
/// (another version of o80, a foreign or damaged file) the lock of its own byte 0 decides.
class NamedSegment {
 public:
  /// Not open, with errno set, if the segment file cannot be opened.
  static NamedSegment open(std::string_view name);

  bool is_open() const noexcept { return file_.is_open(); }
  /// Descriptor of the segment file; without a lock if there is a commanders' file.
  int descriptor() const noexcept { return file_.descriptor(); }
  const std::string& path() const noexcept { return path_; }
  const std::string& commands_path() const noexcept { return commands_path_; }
  /// False if this user may not open the deciding file for writing, and so cannot lock it.
  bool can_lock() const noexcept { return can_lock_; }
  /// Throws SegmentError if the owner of the file is not trusted (file_owner.hpp).
  void check_owner() const;
  /// True if this object now holds the deciding lock. Then check is_current().
  bool try_lock() noexcept;
  /// True if the name still leads to this segment file.
  bool is_current() const noexcept;
  /// True if a living backend has the name. A cleaner, a starter or a dying process may hold the
  /// lock for a moment, so this waits for it up to 100 ms (1 s if the process of the header is
  /// gone). Call it only if try_lock() has failed.
  bool is_alive() const;
  /// The text of the error for a second backend, and what to do instead of stopping the first.
  std::string taken_text(std::string_view otherwise =
                             "give this one another name with --segment (segment in code)") const;
  /// What refuses to remove it while its backend lives.
  std::string in_use_text() const;
  /// Unlinks both files, the segment file first, so that a name never leads to a segment without
  /// its commanders' file. False if the name could not be removed. Needs the lock.
  bool remove() noexcept;
  /// Unlinks the commanders' file, after another segment has got the name. Needs the lock.
  void remove_commands() noexcept;

 private:
  std::string backend_text() const;
  const LockFile& deciding() const noexcept { return commands_.is_open() ? commands_ : file_; }

  std::string name_;
  std::string path_;
  std::string commands_path_;  // empty if there is none
  LockFile file_;
  LockFile commands_;
  bool can_lock_ = false;
};

/// Removes the files of killed starters, cleaners and backends: drafts, and commanders' files
/// without a segment file.
void sweep_orphans();

}  // namespace o80
