#include "o80/memory/segment_list.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstring>

#include "base/printable.hpp"
#include "memory/os/file_lock.hpp"
#include "memory/os/file_owner.hpp"
#include "memory/os/process_start.hpp"
#include "memory/segment/name_socket.hpp"
#include "memory/segment/named_segment.hpp"
#include "memory/segment/segment_file.hpp"
#include "memory/segment/segment_name.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

SegmentEntry describe(const std::string& name) {
  SegmentEntry entry;
  entry.name = name;
  const LockFile file = LockFile::open(segment_path(name), O_RDONLY | O_NOFOLLOW);
  SegmentHeader header{};
  SegmentOffsets offsets{};
  if (!file.is_open()) {
    entry.problem = std::string("it cannot be opened: ") + std::strerror(errno);
    entry.user = owner_of(segment_path(name));
    return entry;
  }
  entry.problem = why_untrusted(file.descriptor());
  if (!entry.problem.empty()) entry.user = owner_of(segment_path(name));
  if (entry.problem.empty()) entry.problem = inspect_segment(file.descriptor(), header, offsets);
  if (!entry.problem.empty()) return entry;

  const auto reads = [&](auto& counter, std::size_t offset) {
    const auto at = static_cast<off_t>(offsets.counters + offset);
    return pread(file.descriptor(), &counter, sizeof counter, at) == sizeof counter;
  };
  std::uint32_t word = 0;
  if (!reads(word, offsetof(Counters, state))) return entry;
  const std::atomic<std::uint32_t> state(word);
  entry.life = life_of(file.descriptor(), state);
  entry.readable = true;
  std::uint64_t halt = 0;
  entry.halted = reads(halt, offsetof(Counters, halted)) && halt != 0;
  entry.pid = header.pid;
  entry.process_start = header.process_start;
  entry.started_at = header.started_at;
  entry.user = printable({header.user, strnlen(header.user, sizeof header.user)});
  entry.program = printable({header.program, strnlen(header.program, sizeof header.program)});
  entry.epoch = header.epoch;
  entry.played = (header.flags & kPlayed) != 0;
  entry.bytes = offsets.file_bytes + offsets.commands_bytes;
  return entry;
}

/// True if the name leads to a file that this user may read and that is no segment of any version.
bool is_foreign(const std::string& name) {
  const LockFile file = LockFile::open(segment_path(name), O_RDONLY | O_NOFOLLOW);
  return file.is_open() && !has_magic(file.descriptor());
}

/// True if the files of this backend have their names, whether it lives or is just ending.
bool has_files(const NameHolder& holder, const SegmentEntry& entry) {
  if (entry.name != holder.name) return false;
  return entry.pid == holder.pid || (!is_over(entry.life) && !is_foreign(entry.name));
}

/// A living backend whose files are gone: its socket is all that is left of its name.
SegmentEntry describe(const NameHolder& holder) {
  SegmentEntry entry;
  entry.name = holder.name;
  entry.life = Life::running;
  entry.pid = holder.pid;
  entry.process_start = process_start(holder.pid);
  struct stat process{};
  if (stat(("/proc/" + std::to_string(holder.pid)).c_str(), &process) == 0)
    entry.started_at = process.st_ctime;
  entry.user = user_name(holder.user);
  entry.problem =
      "its files were removed or replaced: in real time it has halted itself. Nobody can attach to "
      "it; stop it with `o80 stop " +
      holder.name + "` or `kill " + std::to_string(holder.pid) + "`";
  return entry;
}

/// Removes the segment of a dead backend; false if the backend lives or is being replaced.
bool remove_dead(NamedSegment& segment, bool& removed) {
  if (!segment.try_lock()) return false;
  removed = segment.is_current() && segment.remove();
  return true;
}

}  // namespace

const char* SegmentEntry::state() const noexcept {
  return SegmentState{.life = life, .halted = halted, .played = played}.word();
}

std::vector<SegmentEntry> list_segments() {
  std::vector<NameHolder> holders = NameSocket::holders();
  std::vector<SegmentEntry> entries;
  int error = 0;
  const std::vector<SegmentFileName> files = list_files(&error);
  // an empty list would say that nothing runs
  if (error != 0)
    throw SegmentError("the segments in " + segment_directory() + " cannot be listed: " +
                       std::strerror(error) + ". In a container, allow this in its profile");
  for (const SegmentFileName& file : files)
    if (file.kind == SegmentFileName::Kind::segment) entries.push_back(describe(file.name));
  std::erase_if(holders, [&](const NameHolder& holder) {
    return std::ranges::any_of(entries,
                               [&](const SegmentEntry& entry) { return has_files(holder, entry); });
  });
  // a backend shows its socket while its files have their names: one that has just ended is not
  // among those that show it still
  const std::string directory = segment_directory();
  const bool is_hidden = access(directory.c_str(), F_OK) == 0 &&
                         access(directory.c_str(), R_OK | X_OK) != 0;  // the files may be there
  if (holders.empty() || is_hidden) return entries;
  for (const NameHolder& holder : NameSocket::holders())
    if (std::ranges::count(holders, holder) > 0) entries.push_back(describe(holder));
  std::ranges::sort(entries, {}, &SegmentEntry::name);
  return entries;
}

bool clean(std::string_view name) {
  sweep_orphans();
  NamedSegment segment = NamedSegment::open(name);
  bool removed = false;
  if (segment.is_open() && segment.is_alive()) throw SegmentTaken(segment.in_use_text());
  if (segment.can_lock() && !remove_dead(segment, removed))
    throw SegmentTaken(segment.in_use_text());
  if (!removed && access(segment_path(name).c_str(), F_OK) == 0)
    throw SegmentError("segment '" + std::string(name) + "' cannot be removed by this user: " +
                       segment_path(name) + " belongs to user " + owner_of(segment_path(name)));
  return removed;
}

std::vector<std::string> clean_dead() {
  sweep_orphans();
  std::vector<std::string> removed;
  for (const SegmentFileName& file : list_files()) {
    if (file.kind != SegmentFileName::Kind::segment) continue;
    NamedSegment segment = NamedSegment::open(file.name);
    bool is_removed = false;
    if (segment.is_open() && has_magic(segment.descriptor())) remove_dead(segment, is_removed);
    if (is_removed) removed.push_back(file.name);
  }
  return removed;
}

}  // namespace o80
