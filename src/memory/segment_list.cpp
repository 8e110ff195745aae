#include "o80/memory/segment_list.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>

#include "o80/base/error.hpp"
#include "o80/base/printable.hpp"
#include "o80/memory/file_lock.hpp"
#include "o80/memory/segment_file.hpp"
#include "o80/memory/segment_name.hpp"

namespace o80 {

namespace {

constexpr std::string_view kPrefix = "o80-";
constexpr std::string_view kDraft = ".new-";

std::vector<std::string> file_names() {
  std::vector<std::string> names;
  DIR* directory = opendir(segment_directory().c_str());
  if (directory == nullptr) return names;
  while (const dirent* entry = readdir(directory))
    if (std::string_view(entry->d_name).starts_with(kPrefix)) names.emplace_back(entry->d_name);
  closedir(directory);
  std::sort(names.begin(), names.end());
  return names;
}

bool is_draft(std::string_view name) { return name.find(kDraft) != std::string_view::npos; }

LockFile open_file(const std::string& path, int mode) {
  return LockFile::open(path, mode | O_NOFOLLOW);
}

SegmentEntry describe(const std::string& name) {
  SegmentEntry entry;
  entry.name = name;
  const LockFile file = open_file(segment_path(name), O_RDONLY);
  SegmentHeader header{};
  SegmentOffsets offsets{};
  if (!file.is_open() || !inspect_segment(file.descriptor(), header, offsets).empty()) return entry;

  std::uint32_t word = 0;
  const auto where = static_cast<off_t>(offsets.counters + offsetof(Counters, state));
  if (pread(file.descriptor(), &word, sizeof word, where) != sizeof word) return entry;
  const std::atomic<std::uint32_t> state(word);
  entry.life = judge_life(file.descriptor(), state);
  entry.readable = true;
  entry.pid = header.pid;
  entry.started_at = header.started_at;
  entry.user = printable({header.user, strnlen(header.user, sizeof header.user)});
  entry.program = printable({header.program, strnlen(header.program, sizeof header.program)});
  entry.epoch = header.epoch;
  entry.bytes = header.file_bytes;
  return entry;
}

enum class Removal { none, alive, removed };

/// Only who holds byte 0 of the file that bears the name may unlink it.
Removal remove_dead(const std::string& path, bool marked_only) {
  LockFile file = open_file(path, O_RDWR);
  if (!file.is_open()) return Removal::none;
  if (marked_only && !bears_the_mark(file.descriptor())) return Removal::none;
  if (!file.try_lock(kBackendByte)) return Removal::alive;
  if (!leads_to(path, file.descriptor())) return Removal::none;
  return unlink(path.c_str()) == 0 ? Removal::removed : Removal::none;
}

}  // namespace

std::vector<SegmentEntry> list_segments() {
  std::vector<SegmentEntry> entries;
  for (const std::string& file : file_names()) {
    const std::string name = file.substr(kPrefix.size());
    if (is_draft(file) || !is_segment_name(name)) continue;
    entries.push_back(describe(name));
  }
  return entries;
}

bool clean(std::string_view name) {
  const std::string path = segment_path(name);
  const LockFile file = open_file(path, O_RDONLY);
  if (file.is_open() && is_held(file.descriptor(), path))
    throw SegmentTaken(taken_text(name, file.descriptor()));
  switch (remove_dead(path, false)) {
    case Removal::alive:
      throw SegmentTaken(taken_text(name, file.descriptor()));
    case Removal::removed:
      return true;
    case Removal::none:
      break;
  }
  if (access(path.c_str(), F_OK) == 0)
    throw SegmentError("segment '" + std::string(name) + "' cannot be removed by this user (" +
                       path + ")");
  return false;
}

std::vector<std::string> clean_dead() {
  sweep_drafts();
  std::vector<std::string> removed;
  for (const std::string& file : file_names()) {
    if (is_draft(file)) continue;
    const std::string path = segment_directory() + "/" + file;
    if (remove_dead(path, true) == Removal::removed) removed.push_back(file.substr(kPrefix.size()));
  }
  return removed;
}

void sweep_drafts() {
  for (const std::string& file : file_names())
    if (is_draft(file)) remove_dead(segment_directory() + "/" + file, false);
}

}  // namespace o80
