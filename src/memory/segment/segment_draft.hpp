#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <string>

#include "memory/os/file_lock.hpp"
#include "memory/segment/segment_layout.hpp"

namespace o80 {

/// What a new backend has to know of the former backend of its name.
struct Predecessor {
  bool was_halted = false;   // it was halted, or a halt was pending
  bool died_acting = false;  // it was killed while commands, control or a motion were active
};

/// The two files of a segment without a name: the locked commanders' file of its epoch, and the
/// locked segment file under a temporary name, the draft. How a backend takes a name
/// (src/memory/README.md#successor):
///
/// 1. A name with a living backend is refused; orphans are removed.
/// 2. Both files are created, locked, reserved, given their permissions and filled.
/// 3. The draft is linked to the name. If the name is free, all is done.
/// 4. Else the files behind the name are opened, their owner is checked, and byte 0 of that
///    commanders' file is locked. If it stays locked (NamedSegment::is_alive): SegmentTaken.
/// 5. If the name leads to another file by now: step 3 again. Else the former backend is dead, and
///    no other starter can replace it.
/// 6. `superseded` is written into the former segment, and its waiters are woken.
/// 7. Its halts are read, and a halt is requested in the new segment if one was pending or in
///    force, or if the backend was killed while commands acted.
/// 8. The draft is renamed over the name; the former commanders' file is unlinked.
///
/// 6 comes before 7, and a process that has requested a halt reads the state afterwards. So a halt
/// is inherited, or its requester finds `superseded`.
///
/// The destructor removes both files unless publish() has succeeded. If the process dies before,
/// sweep_orphans() removes them later.
class SegmentDraft {
 public:
  enum class Files : std::uint8_t { named, anonymous };
  /// `anonymous`: both files have no name, and publish() cannot be called. Throws SegmentError.
  explicit SegmentDraft(const std::string& name, Files files = Files::named);
  /// Takes the locked files of an anonymous segment, to name them (give_names) and publish them.
  SegmentDraft(const std::string& name, std::uint64_t epoch, LockFile segment, LockFile commands);
  SegmentDraft& operator=(SegmentDraft&&) = delete;
  ~SegmentDraft();

  std::uint64_t epoch() const noexcept { return epoch_; }
  /// Reserves the memory of both files. Throws SegmentError.
  void reserve(const SegmentOffsets& offsets);
  /// Sets who may observe (read bits) and who may command (write bits). Throws SegmentError.
  void permit(mode_t permission);
  /// Opens one of the files again, for a mapping: locked descriptors must not be mapped.
  LockFile open_segment() const { return opened_again(segment_); }
  LockFile open_commands() const { return opened_again(commands_); }
  /// Links anonymous files to the names of a draft. Throws SegmentError.
  void give_names();
  /// Gives the complete segment its name, which it takes over from the segment of a dead backend.
  /// Then `inherit` is called before the rename, so that a halt is kept if this process is killed
  /// right after it. Throws SegmentTaken, SegmentError.
  void publish(const std::function<void(const Predecessor&)>& inherit);

  /// Removes the names of both files, unless publish() has succeeded.
  void abandon() noexcept;

  // for the owner of the published or abandoned segment
  const std::string& commands_path() const noexcept { return commands_path_; }
  LockFile take_segment_lock() noexcept { return std::move(segment_); }
  LockFile take_commands_lock() noexcept { return std::move(commands_); }

 private:
  void create_anonymous_files();
  bool create_commands();
  bool create_segment();
  LockFile opened_again(const LockFile& file) const;
  bool try_replace(const std::function<void(const Predecessor&)>& inherit);
  [[noreturn]] void fail(const std::string& what, int error) const;

  std::string name_;
  std::uint64_t epoch_ = 0;
  std::string path_;
  std::string commands_path_;
  LockFile segment_;   // holds the lock of byte 0
  LockFile commands_;  // holds the lock of byte 0
  bool has_names_ = false;
  bool published_ = false;
};

}  // namespace o80
