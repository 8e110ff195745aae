#include "o80/memory/segment_list.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstring>

#include "base/printable.hpp"
#include "memory/os/file_lock.hpp"
#include "memory/os/file_owner.hpp"
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

  std::uint32_t word = 0;
  const auto where = static_cast<off_t>(offsets.counters + offsetof(Counters, state));
  if (pread(file.descriptor(), &word, sizeof word, where) != sizeof word) return entry;
  const std::atomic<std::uint32_t> state(word);
  entry.life = judge_life(file.descriptor(), state);
  entry.readable = true;
  std::uint64_t halt = 0;
  const auto shown = static_cast<off_t>(offsets.counters + offsetof(Counters, halted));
  entry.halted = pread(file.descriptor(), &halt, sizeof halt, shown) == sizeof halt && halt != 0;
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
  std::vector<SegmentEntry> entries;
  for (const SegmentFileName& file : list_files())
    if (file.kind == SegmentFileName::Kind::segment) entries.push_back(describe(file.name));
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
    if (segment.is_open() && bears_the_mark(segment.descriptor())) remove_dead(segment, is_removed);
    if (is_removed) removed.push_back(file.name);
  }
  return removed;
}

}  // namespace o80
