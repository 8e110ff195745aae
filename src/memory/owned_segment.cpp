#include "o80/memory/owned_segment.hpp"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <limits>
#include <utility>

#include "o80/base/crash_point.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/atomic_words.hpp"
#include "o80/memory/segment_file.hpp"
#include "o80/memory/segment_list.hpp"
#include "o80/memory/segment_name.hpp"

namespace o80 {

namespace {

constexpr int kOpen = O_RDWR | O_NOFOLLOW;

std::uint64_t random_bits() {
  std::uint64_t bits = 0;
  while (bits == 0)
    if (getrandom(&bits, sizeof bits, 0) != sizeof bits) bits = 0;
  return bits;
}

[[noreturn]] void fail(const std::string& name, const std::string& what, int error) {
  throw SegmentError("cannot create segment '" + name + "': " + what + ": " + std::strerror(error));
}

[[noreturn]] void fail_for_space(const std::string& name, std::uint64_t bytes) {
  throw SegmentError("cannot create segment '" + name + "': " + segment_directory() +
                     " has no room for its " + std::to_string((bytes + (1U << 20) - 1) >> 20) +
                     " MiB. Ask for a shorter history, remove dead segments with `o80 clean`, or "
                     "enlarge it (`mount -o remount,size=... " +
                     segment_directory() + "`).");
}

SegmentShape shape_of(const SegmentSpec& spec) {
  if (spec.rows == 0 || spec.rows >= std::numeric_limits<std::uint64_t>::max() / 2)
    throw InvalidArgument("segment '" + spec.name + "': a history has at least one row");
  if (spec.lane_blocks == 0 || spec.lane_blocks > (1U << 24))
    throw InvalidArgument("segment '" + spec.name + "': a lane has 1 to 16777216 blocks");
  return {.page_bytes = static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)),
          .schema_bytes = spec.schema.size(),
          .row_bytes = spec.row_bytes,
          .slots = spec.rows + 1,
          .lanes = spec.lanes,
          .lane_blocks = std::bit_ceil(spec.lane_blocks)};
}

/// A temporary file whose byte 0 is ours; goes away again unless it was given its name.
class Draft {
 public:
  Draft(const std::string& name, const std::string& final_path) {
    for (int attempt = 0; attempt < 100; ++attempt) {
      char suffix[32];
      std::snprintf(suffix, sizeof suffix, ".new-%016" PRIx64, random_bits());
      path_ = final_path + suffix;
      lock_ = LockFile::open(path_, kOpen | O_CREAT | O_EXCL, 0600);
      if (!lock_.is_open() && errno == EEXIST) continue;
      if (!lock_.is_open()) fail(name, "no file can be made in " + segment_directory(), errno);
      O80_CRASH_POINT("create.before_lock");
      // a sweeper may have found the file before it was locked: then it is gone
      if (lock_.try_lock(kBackendByte) && leads_to(path_, lock_.descriptor())) return;
    }
    throw SegmentError("cannot create segment '" + name + "': its file is taken away each time");
  }
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;
  ~Draft() {
    if (lock_.is_open()) unlink(path_.c_str());
  }

  const std::string& path() const noexcept { return path_; }
  int descriptor() const noexcept { return lock_.descriptor(); }
  LockFile named() noexcept { return std::move(lock_); }

 private:
  std::string path_;
  LockFile lock_;
};

void reserve(const Draft& draft, const std::string& name, std::uint64_t bytes) {
  struct statvfs room;
  if (fstatvfs(draft.descriptor(), &room) == 0 && room.f_blocks > 0 &&
      room.f_bavail < bytes / room.f_bsize)
    fail_for_space(name, bytes);
  int error = 0;
  do {
    error = posix_fallocate(draft.descriptor(), 0, static_cast<off_t>(bytes));
  } while (error == EINTR);
  if (error == ENOSPC || error == EFBIG || error == ENOMEM) fail_for_space(name, bytes);
  if (error != 0) fail(name, "its memory cannot be reserved", error);
}

void copy_text(char* to, std::size_t most, const std::string& text) { text.copy(to, most - 1); }

void fill(const SegmentView& view, const SegmentSpec& spec, std::uint64_t epoch) {
  SegmentHeader header{};
  header.magic = kSegmentMagic;
  header.version = kSegmentVersion;
  header.header_bytes = sizeof header;
  header.shape = view.shape;
  header.file_bytes = view.offsets.file_bytes;
  header.epoch = epoch;
  header.started_at = time(nullptr);
  header.pid = getpid();
  copy_text(header.user, sizeof header.user, own_user());
  copy_text(header.program, sizeof header.program, own_program());
  std::memcpy(view.base, &header, sizeof header);
  if (!spec.schema.empty())
    std::memcpy(view.base + view.offsets.schema, spec.schema.data(), spec.schema.size());

  // nobody else sees the file yet
  view.counters().begun.store(-1, std::memory_order_relaxed);
  view.counters().published.store(-1, std::memory_order_relaxed);
  view.bell().wanted.store(std::numeric_limits<std::int64_t>::max(), std::memory_order_relaxed);
}

/// Tells those attached to a dead segment that it has a successor; a file that is no segment
/// has nobody to tell.
void supersede(const std::string& path) {
  const LockFile file = LockFile::open(path, kOpen);
  SegmentHeader header;
  SegmentView view;
  if (!file.is_open() || !inspect_segment(file.descriptor(), header, view.offsets).empty()) return;
  const Mapping mapping(file.descriptor(), view.offsets.file_bytes, Mapping::Protection::read_write,
                        Mapping::Faults::later);
  view.base = mapping.data();
  view.shape = header.shape;
  end_segment(view, State::superseded);
}

/// draft => the file that bears the name
void publish(Draft& draft, const std::string& name, const std::string& path) {
  while (true) {
    O80_CRASH_POINT("create.before_link");
    if (link(draft.path().c_str(), path.c_str()) == 0) {
      O80_CRASH_POINT("create.after_link");
      unlink(draft.path().c_str());
      return;
    }
    if (errno != EEXIST) fail(name, "its file cannot be given its name", errno);

    // the name is there: does anybody live behind it?
    LockFile old = LockFile::open(path, kOpen);
    if (!old.is_open() && errno == ENOENT) continue;
    if (!old.is_open()) fail(name, path + " is in the way and cannot be opened", errno);
    if (!old.try_lock(kBackendByte)) {
      if (is_held(old.descriptor(), path)) throw SegmentTaken(taken_text(name, old.descriptor()));
      continue;
    }
    if (!leads_to(path, old.descriptor())) continue;

    // nobody, and nobody can come while we hold the old one
    supersede(path);
    O80_CRASH_POINT("create.before_rename");
    if (rename(draft.path().c_str(), path.c_str()) != 0)
      fail(name, path + " is in the way and cannot be replaced", errno);
    O80_CRASH_POINT("create.after_rename");
    return;
  }
}

}  // namespace

OwnedSegment OwnedSegment::create(const SegmentSpec& spec) {
  const std::string path = segment_path(spec.name);
  SegmentView view;
  view.shape = shape_of(spec);
  if (!SegmentOffsets::compute(view.shape, view.offsets))
    throw InvalidArgument("segment '" + spec.name + "': rows of " + std::to_string(spec.row_bytes) +
                          " bytes, " + std::to_string(spec.rows) + " of them, and " +
                          std::to_string(spec.lanes) +
                          " lanes make no segment (a row is a multiple of 8 bytes)");
  refuse_if_taken(spec.name);
  sweep_drafts();

  // a complete file, held by us, that nobody can see
  Draft draft(spec.name, path);
  O80_CRASH_POINT("create.after_lock");
  reserve(draft, spec.name, view.offsets.file_bytes);
  OwnedSegment segment;
  segment.query_ = LockFile::open(draft.path(), kOpen);
  if (!segment.query_.is_open()) fail(spec.name, "its file cannot be opened again", errno);
  if (fchmod(draft.descriptor(), spec.permission) != 0)
    fail(spec.name, "its permission cannot be set", errno);
  Mapping mapping(segment.query_.descriptor(), view.offsets.file_bytes,
                  Mapping::Protection::read_write, Mapping::Faults::now);
  view.base = mapping.data();
  segment.epoch_ = random_bits();
  fill(view, spec, segment.epoch_);

  publish(draft, spec.name, path);
  segment.name_ = spec.name;
  segment.path_ = path;
  segment.view_ = view;
  segment.mapping_ = std::move(mapping);
  segment.lock_ = draft.named();
  return segment;
}

void OwnedSegment::refuse_if_taken(std::string_view name) {
  const std::string path = segment_path(name);
  // a descriptor of its own is enough to ask; who may not read it learns so when it creates
  const LockFile file = LockFile::open(path, O_RDONLY | O_NOFOLLOW);
  if (file.is_open() && is_held(file.descriptor(), path))
    throw SegmentTaken(taken_text(name, file.descriptor()));
}

OwnedSegment& OwnedSegment::operator=(OwnedSegment&& other) noexcept {
  if (this == &other) return *this;
  release();
  name_ = std::move(other.name_);
  path_ = std::move(other.path_);
  epoch_ = other.epoch_;
  mapping_ = std::move(other.mapping_);
  query_ = std::move(other.query_);
  lock_ = std::move(other.lock_);
  view_ = other.view_;
  guard_ = other.guard_;
  return *this;
}

OwnedSegment::~OwnedSegment() { release(); }

void OwnedSegment::release() noexcept {
  if (lock_.is_open() && !guard_.forked()) {
    if (state() == State::starting || state() == State::running) end(State::stopped);
    if (state() != State::failed) remove();
  }
  mapping_ = Mapping();
  query_.close();
  lock_.close();
}

State OwnedSegment::state() const noexcept {
  return static_cast<State>(view_.counters().state.load(std::memory_order_relaxed));
}

void OwnedSegment::set_state(State state) noexcept {
  O80_CRASH_POINT("segment.before_state");
  view_.counters().state.store(static_cast<std::uint32_t>(state),
                               std::memory_order_release);  // sync state
  O80_CRASH_POINT("segment.after_state");
}

void OwnedSegment::end(State stopped_or_failed, std::string_view text) noexcept {
  store_text(view_.counters().fault, std::size(view_.counters().fault), text);
  end_segment(view_, stopped_or_failed);
}

void OwnedSegment::remove() noexcept {
  // we hold byte 0: the name cannot change hands between the look and the unlink
  O80_CRASH_POINT("segment.before_unlink");
  if (leads_to(path_, lock_.descriptor())) unlink(path_.c_str());
  O80_CRASH_POINT("segment.after_unlink");
}

void OwnedSegment::check_process() const { guard_.check("the backend of segment '" + name_ + "'"); }

}  // namespace o80
