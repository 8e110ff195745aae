#include "memory/segment/named_segment.hpp"

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <optional>

#include "base/crash_point.hpp"
#include "memory/os/file_owner.hpp"
#include "memory/segment/segment_file.hpp"
#include "memory/segment/segment_name.hpp"
#include "o80/base/error.hpp"
#include "o80/base/time.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kPassing =
    100'000'000;  // of a starter, a cleaner, or one killed on a busy machine
constexpr std::int64_t kDying = 1'000'000'000;  // longest end of a dying process [ns]

std::int64_t patience(int descriptor) noexcept {
  SegmentHeader header{};
  const bool dead = read_header(descriptor, header) && header.pid > 0 && kill(header.pid, 0) != 0 &&
                    errno == ESRCH;
  return dead ? kDying : kPassing;
}

/// The epoch of the segment with this name, 0 if there is none of this version; empty if this user
/// may not read it.
std::optional<std::uint64_t> epoch_behind(std::string_view name) {
  const LockFile file = LockFile::open(segment_path(name), O_RDONLY | O_NOFOLLOW);
  if (file.is_open()) return epoch_of(file.descriptor());
  return errno == ENOENT ? std::optional<std::uint64_t>(0) : std::nullopt;
}

/// Removes the unused files of one epoch of a name.
void sweep(const std::string& name, std::uint64_t epoch) {
  const std::string commands = commands_path(name, epoch);
  LockFile lock = LockFile::open(commands, O_RDWR | O_NOFOLLOW);
  if (lock.is_open()) {
    // the holder of the lock builds this segment, or is its living backend
    if (!lock.try_lock(kBackendByte) || !is_path_of(commands, lock.descriptor())) return;
  } else if (errno != ENOENT) {
    return;
  }
  // from here on this epoch cannot get the name: that needs the lock that we hold, or the
  // commanders' file that is gone
  O80_CRASH_POINT("sweep.before_draft");
  unlink(draft_path(name, epoch).c_str());
  O80_CRASH_POINT("sweep.after_draft");
  const auto bearer = epoch_behind(name);
  if (lock.is_open() && bearer && *bearer != epoch) unlink(commands.c_str());
  O80_CRASH_POINT("sweep.after_commands");
}

}  // namespace

NamedSegment NamedSegment::open(std::string_view name) {
  NamedSegment segment;
  segment.name_ = name;
  segment.path_ = segment_path(name);
  segment.file_ = LockFile::open(segment.path_, O_RDWR | O_NOFOLLOW);
  segment.can_lock_ = segment.file_.is_open();
  if (!segment.can_lock_ && (errno == EACCES || errno == EPERM || errno == EROFS))
    segment.file_ = LockFile::open(segment.path_, O_RDONLY | O_NOFOLLOW);
  if (!segment.file_.is_open()) return segment;

  const std::uint64_t epoch = epoch_of(segment.descriptor());
  if (epoch == 0) return segment;
  segment.commands_path_ = o80::commands_path(name, epoch);
  segment.commands_ = LockFile::open(segment.commands_path_, O_RDWR | O_NOFOLLOW);
  if (segment.commands_.is_open())
    segment.can_lock_ = true;
  else if (errno == ENOENT)
    segment.commands_path_.clear();
  else
    segment.can_lock_ = false;
  return segment;
}

void NamedSegment::check_owner() const {
  const std::string why = why_untrusted(descriptor());
  if (!why.empty())
    throw SegmentError(
        "the name '" + name_ + "' is in use: " + path_ + " exists, and " + why +
        ". Otherwise remove that file, choose another name with --segment (segment in code), or "
        "another directory with O80_DIRECTORY.");
}

bool NamedSegment::try_lock() noexcept {
  return can_lock_ && (commands_.is_open() ? commands_ : file_).try_lock(kBackendByte);
}

bool NamedSegment::is_current() const noexcept { return is_path_of(path_, descriptor()); }

bool NamedSegment::is_alive() const {
  const std::int64_t end = monotonic_now() + patience(descriptor());
  while (is_byte_locked(deciding().descriptor(), kBackendByte)) {
    if (monotonic_now() >= end) return is_current();
    usleep(1000);
  }
  return false;
}

std::string NamedSegment::backend_text() const {
  SegmentHeader header{};
  const bool known = epoch_of(descriptor()) != 0 && read_header(descriptor(), header);
  return "a backend" + (known ? " (" + describe_owner(header) + ")" : std::string());
}

std::string NamedSegment::in_use_text() const {
  return "segment '" + name_ + "' is not removed: it still has " + backend_text() +
         ". Stop it first with `o80 stop " + name_ + "`";
}

std::string NamedSegment::taken_text(std::string_view otherwise) const {
  return "segment '" + name_ + "' already has " + backend_text() +
         ".\nStop it first with `o80 stop " + name_ + "`, or " + std::string(otherwise) + ".";
}

bool NamedSegment::remove() noexcept {
  O80_CRASH_POINT("clean.before_unlink");
  if (unlink(path_.c_str()) != 0) return false;
  O80_CRASH_POINT("clean.between_unlinks");
  remove_commands();
  O80_CRASH_POINT("clean.after_unlink");
  return true;
}

void NamedSegment::remove_commands() noexcept {
  if (!commands_path_.empty()) unlink(commands_path_.c_str());
}

void sweep_orphans() {
  for (const SegmentFileName& file : list_files())
    if (file.kind != SegmentFileName::Kind::segment) sweep(file.name, file.epoch);
}

}  // namespace o80
