#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <string>

#include "memory/file_lock.hpp"
#include "memory/segment_layout.hpp"

namespace o80 {

/// What the backend that had the name before left behind.
struct Predecessor {
  bool was_halted = false;   // or a halt was asked for that it never saw
  bool died_acting = false;  // it was killed while commands, control or a motion acted
};

/// The two files of a segment that has no name yet: the commanders' file, locked and called after
/// its epoch, and the segment file, locked and called a draft.
///
/// Whoever dies with one leaves files that sweep_orphans() removes; so does the destructor, unless
/// publish() gave the segment its name.
class SegmentDraft {
 public:
  /// Throws SegmentError.
  explicit SegmentDraft(const std::string& name);
  SegmentDraft(const SegmentDraft&) = delete;
  SegmentDraft& operator=(const SegmentDraft&) = delete;
  ~SegmentDraft();

  std::uint64_t epoch() const noexcept { return epoch_; }
  /// Reserves the memory of both files. Throws SegmentError.
  void reserve(const SegmentOffsets& offsets);
  /// Read bits say who may observe, write bits who may command. Throws SegmentError.
  void permit(mode_t permission);
  /// Opens one of them again, for a mapping: the locks stay on descriptors that are never mapped.
  LockFile open_segment() const { return open_again(path_); }
  LockFile open_commands() const { return open_again(commands_path_); }
  /// Gives it its name, when complete; the segment of a dead backend is taken over, and `inherit`
  /// is called before the name changes hands: a successor that is killed just after has inherited
  /// too. Throws SegmentTaken, SegmentError.
  void publish(const std::function<void(const Predecessor&)>& inherit);

  // what the owner of the published segment keeps
  const std::string& commands_path() const noexcept { return commands_path_; }
  LockFile take_segment_lock() noexcept { return std::move(segment_); }
  LockFile take_commands_lock() noexcept { return std::move(commands_); }

 private:
  bool create_commands();
  bool create_segment();
  LockFile open_again(const std::string& path) const;
  bool try_replace(const std::function<void(const Predecessor&)>& inherit);
  [[noreturn]] void fail(const std::string& what, int error) const;

  std::string name_;
  std::uint64_t epoch_ = 0;
  std::string path_;
  std::string commands_path_;
  LockFile segment_;   // holds byte 0
  LockFile commands_;  // holds byte 0
  bool published_ = false;
};

}  // namespace o80
