#include "memory/segment/segment_draft.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <vector>

#include "base/crash_point.hpp"
#include "memory/os/file_owner.hpp"
#include "memory/os/mapping.hpp"
#include "memory/os/random_bits.hpp"
#include "memory/segment/anonymous_file.hpp"
#include "memory/segment/named_segment.hpp"
#include "memory/segment/segment_file.hpp"
#include "memory/segment/segment_name.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr int kOpen = O_RDWR | O_NOFOLLOW;
constexpr int kAttempts = 100;

[[noreturn]] void fail_for_space(const std::string& name, std::uint64_t bytes) {
  throw SegmentError("cannot create segment '" + name + "': " + segment_directory() +
                     " has no room for its " + std::to_string((bytes + (1U << 20) - 1) >> 20) +
                     " MiB. Use a shorter history, remove dead segments with `o80 clean`, or "
                     "enlarge it (`mount -o remount,size=... " +
                     segment_directory() + "`).");
}

Mapping map(const LockFile& file, std::uint64_t bytes) {
  return {file.descriptor(), bytes, Mapping::Protection::read_write, Mapping::Faults::later};
}

/// Reserves the blocks of a file by writing it. Returns an error number.
int fill_with_zeros(int descriptor, std::uint64_t bytes) {
  const std::vector<char> zeros(1U << 16);
  for (std::uint64_t at = 0; at < bytes;) {
    const std::uint64_t part = std::min<std::uint64_t>(zeros.size(), bytes - at);
    const ssize_t written = pwrite(descriptor, zeros.data(), part, static_cast<off_t>(at));
    if (written < 0 && errno != EINTR) return errno;
    if (written > 0) at += static_cast<std::uint64_t>(written);
  }
  return 0;
}

BackendState state_of(const SegmentView& view) {
  return static_cast<BackendState>(
      view.counters().state.load(std::memory_order_acquire));  // sync state
}

/// Reads what a dead backend has left, after its segment was marked as superseded. `state`: its
/// state word before that mark, which may be the mark of an earlier starter that died.
Predecessor judge_predecessor(const SegmentView& view, BackendState state) {
  const Counters& counters = view.counters();
  Predecessor predecessor;
  predecessor.was_halted = counters.halted.load(std::memory_order_acquire) != 0;  // sync halted
  if (view.commands != nullptr)
    // a read-modify-write, not a load: the requester of any later halt sees the mark `superseded`
    // (runtime/frontend/frontend_halt.cpp)
    predecessor.was_halted |=
        view.bell().halts.fetch_add(0, std::memory_order_seq_cst) !=  // sync halts
        counters.cleared.load(std::memory_order_acquire);             // sync cleared
  predecessor.died_acting = counters.acts.load(std::memory_order_relaxed) != 0 &&
                            state != BackendState::stopped && state != BackendState::failed;
  return predecessor;
}

/// Marks the segment of a dead backend as superseded and wakes its waiters. Does nothing for a file
/// that is not a segment, or that this user may not write.
Predecessor supersede(const NamedSegment& former) {
  // other descriptors than those of `former`: a locked descriptor must not be mapped, because a
  // forked child would keep the lock with the mapping
  const LockFile segment = LockFile::open(former.path(), kOpen);
  SegmentHeader header{};
  SegmentView view;
  if (!segment.is_open() || !inspect_segment(segment.descriptor(), header, view.offsets).empty())
    return {};
  view.shape = header.shape;
  const Mapping mapping = map(segment, view.offsets.file_bytes);
  view.base = mapping.data();

  Mapping commands_mapping;
  const LockFile commands = LockFile::open(former.commands_path(), kOpen);
  if (commands.is_open() &&
      inspect_commands(commands.descriptor(), segment.descriptor(), header, view.offsets).empty()) {
    commands_mapping = map(commands, view.offsets.commands_bytes);
    view.commands = commands_mapping.data();
  }
  const BackendState state = state_of(view);
  end_segment(view, BackendState::superseded);
  // a halt in a recording was one of another robot, at another time
  if ((header.flags & kPlayed) != 0) return {};
  return judge_predecessor(view, state);
}

}  // namespace

SegmentDraft::SegmentDraft(const std::string& name, Files files)
    : name_(name), has_names_(files == Files::named) {
  if (files == Files::anonymous) {
    create_anonymous_files();
    return;
  }
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    epoch_ = random_bits();
    commands_path_ = o80::commands_path(name, epoch_);
    path_ = draft_path(name, epoch_);
    if (create_commands() && create_segment()) return;
  }
  throw SegmentError("cannot create segment '" + name +
                     "': another process has removed its files " + std::to_string(kAttempts) +
                     " times. Try again; does `o80 clean` run in a loop?");
}

SegmentDraft::SegmentDraft(const std::string& name, std::uint64_t epoch, LockFile segment,
                           LockFile commands)
    : name_(name),
      epoch_(epoch),
      path_(draft_path(name, epoch)),
      commands_path_(o80::commands_path(name, epoch)),
      segment_(std::move(segment)),
      commands_(std::move(commands)) {}

void SegmentDraft::create_anonymous_files() {
  epoch_ = random_bits();
  for (LockFile* file : {&commands_, &segment_}) {
    *file = create_anonymous();
    if (!file->is_open()) fail("no file can be made in " + segment_directory(), errno);
    // cannot fail: no other process can open the file
    file->try_lock(kBackendByte);
  }
}

void SegmentDraft::give_names() {
  has_names_ = true;
  // the commanders' file first: a segment file without one would be taken for a foreign file
  if (!link_open_file(commands_, commands_path_) || !link_open_file(segment_, path_))
    fail(errno == ENOENT ? "the file system of " + segment_directory() +
                               " cannot name a file that was made without a name"
                         : "its files cannot be named",
         errno);
}

/// False if sweep_orphans() of another process has removed the file before it was locked.
bool SegmentDraft::create_commands() {
  commands_ = LockFile::open(commands_path_, kOpen | O_CREAT | O_EXCL, 0600);
  if (!commands_.is_open() && errno == EEXIST) return false;
  if (!commands_.is_open()) fail("no file can be made in " + segment_directory(), errno);
  O80_CRASH_POINT("create.before_lock");
  if (!commands_.try_lock(kBackendByte)) {
    const std::string why = why_locks_are_refused();
    if (why.empty()) return false;
    unlink(commands_path_.c_str());
    throw SegmentError("cannot create segment '" + name_ + "': " + why + ".");
  }
  if (!is_path_of(commands_path_, commands_.descriptor())) return false;
  O80_CRASH_POINT("create.after_lock");
  return true;
}

bool SegmentDraft::create_segment() {
  segment_ = LockFile::open(path_, kOpen | O_CREAT | O_EXCL, 0600);
  if (!segment_.is_open()) {
    const int error = errno;
    unlink(commands_path_.c_str());
    fail("no file can be made in " + segment_directory(), error);
  }
  O80_CRASH_POINT("create.after_draft");
  // cannot fail: no other process opens the file before permit()
  return segment_.try_lock(kBackendByte);
}

SegmentDraft::~SegmentDraft() { abandon(); }

void SegmentDraft::abandon() noexcept {
  if (published_ || !has_names_) return;
  if (segment_.is_open()) unlink(path_.c_str());
  if (commands_.is_open()) unlink(commands_path_.c_str());
}

void SegmentDraft::fail(const std::string& what, int error) const {
  const std::string problem = error == ENOENT ? directory_problem() : "";
  if (!problem.empty()) throw SegmentError("cannot create segment '" + name_ + "'. " + problem);
  throw SegmentError("cannot create segment '" + name_ + "': " + what + ": " +
                     std::strerror(error));
}

LockFile SegmentDraft::opened_again(const LockFile& original) const {
  LockFile file = open_again(original, O_RDWR);
  if (!file.is_open()) fail("its file cannot be opened again", errno);
  return file;
}

void SegmentDraft::reserve(const SegmentOffsets& offsets) {
  const std::uint64_t all = offsets.file_bytes + offsets.commands_bytes;
  struct statvfs room;
  if (fstatvfs(segment_.descriptor(), &room) == 0 && room.f_blocks > 0 &&
      room.f_bavail < all / room.f_bsize)
    fail_for_space(name_, all);
  for (const auto& [file, bytes] :
       {std::pair(&segment_, offsets.file_bytes), std::pair(&commands_, offsets.commands_bytes)}) {
    int error = 0;
    do {
      error = posix_fallocate(file->descriptor(), 0, static_cast<off_t>(bytes));
    } while (error == EINTR);
    if (error == EPERM || error == ENOSYS) error = fill_with_zeros(file->descriptor(), bytes);
    if (error == ENOSPC || error == EFBIG || error == ENOMEM) fail_for_space(name_, all);
    if (error != 0) fail("its memory cannot be reserved", error);
  }
}

void SegmentDraft::permit(mode_t permission) {
  if (fchmod(commands_.descriptor(), commanders_mode(permission)) != 0 ||
      fchmod(segment_.descriptor(), observers_mode(permission)) != 0)
    fail("its permission cannot be set", errno);
}

void SegmentDraft::publish(const std::function<void(const Predecessor&)>& inherit) {
  const std::string path = segment_path(name_);
  while (!published_) {
    O80_CRASH_POINT("create.before_link");
    if (link(path_.c_str(), path.c_str()) == 0) {
      published_ = true;
      O80_CRASH_POINT("create.after_link");
      unlink(path_.c_str());
    } else if (errno == EEXIST) {
      published_ = try_replace(inherit);
    } else {
      fail("its file cannot be given its name", errno);
    }
  }
}

/// False if the file behind the name must be examined again. Throws SegmentTaken, SegmentError.
bool SegmentDraft::try_replace(const std::function<void(const Predecessor&)>& inherit) {
  NamedSegment former = NamedSegment::open(name_);
  const std::string& path = former.path();
  if (!former.is_open() && errno == ENOENT) return false;
  if (!former.is_open()) {
    const int error = errno;
    fail(path + " of user " + owner_of(path) + " exists and cannot be opened", error);
  }
  former.check_owner();
  if (!former.can_lock()) fail(path + " exists and cannot be replaced", EACCES);
  if (!former.try_lock()) {
    if (former.is_alive()) throw SegmentTaken(former.taken_text());
    return false;
  }
  if (!former.is_current()) return false;

  // its backend is dead, and no other process can replace it while we hold its lock
  inherit(supersede(former));
  O80_CRASH_POINT("create.before_rename");
  if (rename(path_.c_str(), path.c_str()) != 0)
    fail(path + " exists and cannot be replaced", errno);
  O80_CRASH_POINT("create.after_rename");
  published_ = true;
  former.remove_commands();
  O80_CRASH_POINT("create.after_former");
  return true;
}

}  // namespace o80
