#include "memory/segment/segment_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/crash_point.hpp"
#include "base/printable.hpp"
#include "memory/os/file_lock.hpp"
#include "memory/os/file_owner.hpp"
#include "memory/os/futex.hpp"

namespace o80 {

namespace {

std::string text_of(const char* chars, std::size_t most) {
  return printable({chars, strnlen(chars, most)});
}

}  // namespace

bool is_path_of(const std::string& path, int descriptor) noexcept {
  struct stat named, open;
  return lstat(path.c_str(), &named) == 0 && fstat(descriptor, &open) == 0 &&
         named.st_dev == open.st_dev && named.st_ino == open.st_ino;
}

bool FileNames::are_replaced() const noexcept {
  return std::ranges::any_of(names, [](const Name& name) {
    struct stat found, open;
    // a refused call says nothing
    if (lstat(name.path.c_str(), &found) != 0) return errno == ENOENT || errno == ENOTDIR;
    return fstat(name.descriptor, &open) == 0 &&
           (found.st_dev != open.st_dev || found.st_ino != open.st_ino);
  });
}

bool has_magic(int descriptor) noexcept {
  std::uint64_t magic = 0;
  return pread(descriptor, &magic, sizeof magic, 0) == sizeof magic && magic == kSegmentMagic;
}

bool read_header(int descriptor, SegmentHeader& header) noexcept {
  return pread(descriptor, &header, sizeof header, 0) == sizeof header;
}

std::uint64_t epoch_of(int descriptor) noexcept {
  SegmentHeader header{};
  const bool is_one = read_header(descriptor, header) && header.magic == kSegmentMagic &&
                      header.version == kSegmentVersion;
  return is_one ? header.epoch : 0;
}

std::string inspect_segment(int descriptor, SegmentHeader& header, SegmentOffsets& offsets) {
  struct stat status;
  if (fstat(descriptor, &status) != 0) return std::strerror(errno);
  if (!S_ISREG(status.st_mode)) return "it is not a regular file";
  if (pread(descriptor, &header, 1, 0) < 0) return std::strerror(errno);
  if (!has_magic(descriptor)) return "it was not made by o80";
  if (!read_header(descriptor, header)) return "it is truncated";
  if (header.version != kSegmentVersion || header.header_bytes != sizeof header)
    return "it is of version " + std::to_string(header.version) + ", this o80 reads version " +
           std::to_string(kSegmentVersion) + " only";
  if (header.shape.page_bytes != static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) ||
      !SegmentOffsets::compute(header.shape, offsets) || header.epoch == 0 ||
      header.file_bytes != offsets.file_bytes)
    return "its header is corrupted";
  if (static_cast<std::uint64_t>(status.st_size) < offsets.file_bytes) return "it is truncated";
  if (static_cast<std::uint64_t>(status.st_size) > offsets.file_bytes)
    return "it is longer than its header says";
  return {};
}

std::string inspect_commands(int commands, int segment, const SegmentHeader& header,
                             const SegmentOffsets& offsets) {
  struct stat status{}, of_segment{};
  if (fstat(commands, &status) != 0 || fstat(segment, &of_segment) != 0)
    return std::strerror(errno);
  if (!S_ISREG(status.st_mode)) return "it is not a regular file";
  if (status.st_uid != of_segment.st_uid) return "it has another owner than the segment";
  CommandsHeader found{};
  if (pread(commands, &found, sizeof found, 0) != sizeof found ||
      static_cast<std::uint64_t>(status.st_size) != offsets.commands_bytes)
    return "it does not have the size that the segment says";
  if (found.magic != kCommandsMagic || found.version != header.version ||
      found.header_bytes != sizeof found || found.file_bytes != offsets.commands_bytes ||
      found.epoch != header.epoch)
    return "its header is corrupted";
  return {};
}

mode_t observers_mode(mode_t permission) noexcept {
  return 0600 | (permission & 0444) | (permission & 0222) << 1;
}

mode_t commanders_mode(mode_t permission) noexcept {
  return 0600 | (permission & 0222) | (permission & 0222) << 1;
}

const char* name_of(Life life) noexcept {
  constexpr const char* kNames[] = {"starting",   "running", "stopped", "failed",
                                    "superseded", "killed",  "unknown"};
  return kNames[static_cast<std::size_t>(life)];
}

const char* SegmentState::word() const noexcept {
  if (life != Life::starting && life != Life::running) return name_of(life);
  if (hangs) return "hangs";
  if (halted) return "halted";
  return played && life == Life::running ? "played" : name_of(life);
}

Life life_of(int descriptor, const std::atomic<std::uint32_t>& state) noexcept {
  // load the state after the lock: a backend stores its end before it releases the lock
  const bool held = is_byte_locked(descriptor, kBackendByte);
  const auto stored = static_cast<Life>(state.load(std::memory_order_acquire));  // sync state
  if (stored == Life::stopped || stored == Life::failed || stored == Life::superseded)
    return stored;
  if (!held) return Life::killed;
  return stored == Life::starting ? Life::starting : Life::running;
}

void end_segment(const SegmentView& view, BackendState state) noexcept {
  Counters& counters = view.counters();
  O80_CRASH_POINT("segment.before_end");
  counters.state.store(static_cast<std::uint32_t>(state), std::memory_order_seq_cst);  // sync state
  O80_CRASH_POINT("segment.after_end");
  if (view.commands == nullptr) return;  // observers poll
  Wakes& wakes = view.wakes();
  wakes.row_wake.fetch_add(1, std::memory_order_seq_cst);  // sync row_wake
  futex_wake(wakes.row_wake, kEverybody);
  for (std::uint32_t i = 0; i < view.shape.lanes; ++i) {
    LaneFeedback& feedback = view.feedback(i);
    feedback.events.fetch_add(1, std::memory_order_seq_cst);  // sync events
  }
  wakes.lane_wake.fetch_add(1, std::memory_order_seq_cst);  // sync lane_wake
  futex_wake(wakes.lane_wake, kEverybody);
}

std::string describe_owner(const SegmentHeader& header) {
  const time_t started = header.started_at;
  const time_t now = time(nullptr);
  tm then{}, today{};
  localtime_r(&started, &then);
  localtime_r(&now, &today);
  const bool same_day = then.tm_year == today.tm_year && then.tm_yday == today.tm_yday;

  char clock[32] = "";
  strftime(clock, sizeof clock, same_day ? "%H:%M" : "%Y-%m-%d %H:%M", &then);
  return "pid " + std::to_string(header.pid) + ", started " + clock + " by " +
         text_of(header.user, sizeof header.user);
}

std::string own_user() { return user_name(geteuid()); }

std::string own_program() {
  char name[64] = "";
  const int file = open("/proc/self/comm", O_RDONLY | O_CLOEXEC);
  if (file < 0) return "unknown";
  ssize_t length = read(file, name, sizeof name - 1);
  close(file);
  while (length > 0 && name[length - 1] == '\n') --length;
  return text_of(name, length > 0 ? static_cast<std::size_t>(length) : 0);
}

std::string own_process() { return "pid " + std::to_string(getpid()) + " (" + own_program() + ")"; }

}  // namespace o80
