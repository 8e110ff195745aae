#include "memory/segment/owned_segment.hpp"

#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <limits>
#include <utility>

#include "base/crash_point.hpp"
#include "memory/os/atomic_words.hpp"
#include "memory/os/process_start.hpp"
#include "memory/segment/halt_word.hpp"
#include "memory/segment/named_segment.hpp"
#include "memory/segment/segment_draft.hpp"
#include "memory/segment/segment_name.hpp"
#include "o80/base/error.hpp"
#include "o80/base/time.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kEnding = 1'000'000'000;  // longest end of a former holder's process [ns]

std::uint64_t journal_bytes_of(const SegmentSpec& spec) {
  if (spec.journal_bytes == 0) return 0;
  if (spec.journal_bytes > (1ULL << 40))
    throw InvalidArgument("segment '" + spec.name + "': the journal must be at most 1 TiB");
  return std::bit_ceil(std::max(spec.journal_bytes, kMinJournal));
}

SegmentShape shape_of(const SegmentSpec& spec) {
  if (spec.rows == 0 || spec.rows >= std::numeric_limits<std::uint64_t>::max() / 2)
    throw InvalidArgument("segment '" + spec.name + "': the history must have at least one row");
  if (spec.lane_blocks == 0 || spec.lane_blocks > (1U << 24))
    throw InvalidArgument("segment '" + spec.name + "': a lane must have 1 to 16777216 blocks");
  return {.page_bytes = static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)),
          .schema_bytes = spec.schema.size(),
          .provenance_bytes = spec.provenance.size(),
          .row_bytes = spec.row_bytes,
          .slots = spec.rows + 1,
          .lanes = spec.lanes,
          .lane_blocks = std::bit_ceil(spec.lane_blocks),
          .journal_bytes = journal_bytes_of(spec)};
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
  header.flags = spec.played ? kPlayed : 0;
  header.process_start = process_start(header.pid);
  copy_text(header.user, sizeof header.user, own_user());
  copy_text(header.program, sizeof header.program, own_program());
  std::memcpy(view.base, &header, sizeof header);
  const CommandsHeader commands{.magic = kCommandsMagic,
                                .version = kSegmentVersion,
                                .header_bytes = sizeof commands,
                                .file_bytes = view.offsets.commands_bytes,
                                .epoch = epoch};
  std::memcpy(view.commands, &commands, sizeof commands);
  if (!spec.schema.empty())
    std::memcpy(view.base + view.offsets.schema, spec.schema.data(), spec.schema.size());
  if (!spec.provenance.empty())
    std::memcpy(view.base + view.offsets.provenance, spec.provenance.data(),
                spec.provenance.size());

  // relaxed: no other process can see the files yet
  view.counters().begun.store(-1, std::memory_order_relaxed);
  view.counters().published.store(-1, std::memory_order_relaxed);
  view.bell().wanted.store(std::numeric_limits<std::int64_t>::max(), std::memory_order_relaxed);
}

/// Binds the socket of a name that no living backend has. Another starter may hold it for a moment;
/// where no socket is granted, the locks of the files alone decide.
NameSocket take_name(std::string_view name) {
  const std::int64_t end = monotonic_now() + kEnding;
  while (true) {
    OwnedSegment::refuse_if_taken(name);
    NameSocket socket = NameSocket::take(name);
    if (socket.is_open() || errno != EADDRINUSE || monotonic_now() >= end) return socket;
    usleep(1000);
  }
}

}  // namespace

OwnedSegment OwnedSegment::create(const SegmentSpec& spec) {
  const std::string path = spec.anonymous ? "" : segment_path(spec.name);
  SegmentView view;
  view.shape = shape_of(spec);
  if (!SegmentOffsets::compute(view.shape, view.offsets))
    throw InvalidArgument(
        "segment '" + spec.name + "': invalid sizes: " + std::to_string(spec.rows) + " rows of " +
        std::to_string(spec.row_bytes) + " bytes and " + std::to_string(spec.lanes) +
        " lanes. A row must be a multiple of 8 bytes, a segment must be below 64 TiB, and there "
        "must be at most " +
        std::to_string(kMaxLanes) + " lanes.");
  NameSocket socket;
  if (!spec.anonymous) {
    socket = take_name(spec.name);
    sweep_orphans();
  }

  // build two complete and locked files that have no name yet
  SegmentDraft draft(spec.name,
                     spec.anonymous ? SegmentDraft::Files::anonymous : SegmentDraft::Files::named);
  draft.reserve(view.offsets);
  draft.permit(spec.permission);
  const LockFile mapped = draft.open_segment();
  OwnedSegment segment;
  segment.query_ = draft.open_commands();
  Mapping mapping(mapped.descriptor(), view.offsets.file_bytes, Mapping::Protection::read_write,
                  Mapping::Faults::now);
  Mapping commands_mapping(segment.query_.descriptor(), view.offsets.commands_bytes,
                           Mapping::Protection::read_write, Mapping::Faults::now);
  view.base = mapping.data();
  view.commands = commands_mapping.data();
  fill(view, spec, draft.epoch());

  const auto inherit = [&](const Predecessor& former) {
    if (!spec.inherits_halt || !(former.was_halted || former.died_acting)) return;
    request_halt(view, HaltCause::predecessor, {},
                 former.was_halted ? "the former backend was halted and not resumed"
                                   : "the former backend was killed while commands were active");
  };
  if (!spec.anonymous) {
    draft.publish(inherit);
    socket.show();
  }
  segment.name_ = spec.name;
  segment.path_ = path;
  segment.commands_path_ = draft.commands_path();
  segment.epoch_ = draft.epoch();
  segment.view_ = view;
  segment.mapping_ = std::move(mapping);
  segment.commands_mapping_ = std::move(commands_mapping);
  segment.lock_ = draft.take_segment_lock();
  segment.commands_lock_ = draft.take_commands_lock();
  segment.socket_ = std::move(socket);
  return segment;
}

void OwnedSegment::refuse_if_taken(std::string_view name) {
  // the socket of a process that is just ending may outlive its locks
  const std::int64_t end = monotonic_now() + kEnding;
  while (true) {
    const NamedSegment bearer = NamedSegment::open(name);
    if (bearer.is_open()) bearer.check_owner();
    if (bearer.is_open() && bearer.is_alive()) throw SegmentTaken(bearer.taken_text());
    const int holder = NameSocket::holder_of(name);
    if (holder == 0) return;
    if (monotonic_now() >= end)
      throw SegmentTaken("segment '" + std::string(name) + "' already has a backend (pid " +
                         std::to_string(holder) + "), whose files were removed from " +
                         segment_directory() + ".\nStop it first with `o80 stop " +
                         std::string(name) + "`, or give this one another name with --segment.");
    usleep(10'000);
  }
}

FileNames OwnedSegment::names() const {
  if (path_.empty()) return {};
  return {{{path_, lock_.descriptor()}, {commands_path_, commands_lock_.descriptor()}}};
}

void OwnedSegment::publish(const std::string& name) {
  check_process();
  const std::string path = segment_path(name);
  if (!path_.empty())
    throw Error("segment '" + name_ +
                "' has a name already: " + path_.substr(path_.rfind('/') + 1));
  NameSocket socket = take_name(name);
  sweep_orphans();
  SegmentDraft draft(name, epoch_, std::move(lock_), std::move(commands_lock_));
  const auto take_back = [&] {
    draft.abandon();
    lock_ = draft.take_segment_lock();
    commands_lock_ = draft.take_commands_lock();
  };
  try {
    draft.give_names();
    draft.publish([](const Predecessor&) {});
    socket.show();
  } catch (...) {
    take_back();
    throw;
  }
  path_ = path;
  commands_path_ = draft.commands_path();
  socket_ = std::move(socket);
  take_back();
}

OwnedSegment::~OwnedSegment() {
  if (!lock_.is_open() || guard_.forked()) return;
  end_if_alive();
  if (state() != BackendState::failed) remove();
}

void OwnedSegment::end_and_remove() noexcept {
  if (!lock_.is_open() || guard_.forked()) return;
  end_if_alive();
  remove();
}

void OwnedSegment::end_if_alive() noexcept {
  if (state() == BackendState::starting || state() == BackendState::running)
    end(BackendState::stopped);
}

BackendState OwnedSegment::state() const noexcept {
  return static_cast<BackendState>(view_.counters().state.load(std::memory_order_relaxed));
}

void OwnedSegment::set_state(BackendState state) noexcept {
  O80_CRASH_POINT("segment.before_state");
  view_.counters().state.store(static_cast<std::uint32_t>(state),
                               std::memory_order_release);  // sync state
  O80_CRASH_POINT("segment.after_state");
}

void OwnedSegment::end(BackendState stopped_or_failed, std::string_view text) noexcept {
  store_text(view_.counters().fault, std::size(view_.counters().fault), text);
  end_segment(view_, stopped_or_failed);
}

void OwnedSegment::remove() noexcept {
  if (path_.empty()) return;  // anonymous
  socket_.close();
  // we hold byte 0, so no other segment can get the name between the check and the unlink
  O80_CRASH_POINT("segment.before_unlink");
  if (is_path_of(path_, lock_.descriptor())) unlink(path_.c_str());
  O80_CRASH_POINT("segment.between_unlinks");
  unlink(commands_path_.c_str());
  O80_CRASH_POINT("segment.after_unlink");
}

void OwnedSegment::check_process() const { guard_.check("the backend of segment '" + name_ + "'"); }

}  // namespace o80
