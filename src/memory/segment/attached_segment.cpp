#include "memory/segment/attached_segment.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>
#include <vector>

#include "memory/os/atomic_words.hpp"
#include "memory/os/file_owner.hpp"
#include "memory/segment/anonymous_file.hpp"
#include "memory/segment/owned_segment.hpp"
#include "memory/segment/segment_file.hpp"
#include "memory/segment/segment_name.hpp"
#include "memory/segment/verb_word.hpp"
#include "o80/base/error.hpp"
#include "o80/base/nearest_name.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kPoll = 1'000'000;  // interval of attach() [ns]
constexpr int kPollsBetweenChecks = 20;
constexpr std::int64_t kKnownFor = 20'000'000;  // validity of a query of the lock [ns]

std::string segment_called(std::string_view name) { return "segment '" + std::string(name) + "'"; }

/// For a name that no segment has: what may be meant, what there is, and what to do.
std::string other_segments(std::string_view name) {
  if (const std::string problem = directory_problem(); !problem.empty()) return problem;
  std::vector<std::string> names;
  std::vector<std::string> known;
  for (const SegmentEntry& entry : list_segments()) {
    if (entry.name == name && entry.life == Life::running && !entry.readable)
      return "A backend of that name runs, but " + entry.problem;
    names.push_back(entry.name);
    known.push_back(entry.name + " (" + entry.state() + ")");
  }
  if (names.empty()) return "Nothing runs in " + segment_directory() + ": start a robot, `o80 run`";
  const std::string near = nearest_name(name, names);
  if (!near.empty()) return "Did you mean '" + near + "'? `o80 list` shows all";
  return "There are: " + first_names(known) + ". Start a robot with `o80 run`";
}

/// Why a backend that starts is not there yet.
std::string starting_text(const AttachedSegment& segment) {
  std::string text =
      "its backend (pid " + std::to_string(segment.header().pid) + ") is still starting";
  const SlowVerb slow = slow_verb(segment.view());
  if (slow.verb == Verb::none) return text;
  const std::int64_t seconds = (monotonic_now() - slow.since) / 1'000'000'000;
  return text + ": " + std::string(to_text(slow.verb)) + "() of its driver has been running for " +
         std::to_string(seconds) + " s";
}

}  // namespace

std::optional<AttachedSegment> AttachedSegment::open(std::string_view name, Access access,
                                                     std::string& reason) {
  AttachedSegment segment;
  segment.name_ = name;
  segment.path_ = segment_path(name);
  segment.access_ = access;
  segment.file_ = LockFile::open(segment.path_, O_RDONLY | O_NOFOLLOW);
  if (!segment.file_.is_open()) {
    const int error = errno;
    reason = "no segment has that name";
    if (error == ENOENT) return std::nullopt;
    throw SegmentError(segment_called(name) + " cannot be opened (" + segment.path_ + " of user " +
                       owner_of(segment.path_) + "): " + std::strerror(error) +
                       (error == EACCES
                            ? ". To let this user read it, start its backend with --permission 640 "
                              "(its group) or 644 (everybody)."
                            : ""));
  }

  const std::string untrusted = why_untrusted(segment.descriptor());
  if (!untrusted.empty())
    throw SegmentError(segment_called(name) + " is not attached to (" + segment.path_ +
                       "): " + untrusted + ".");
  const std::string wrong =
      inspect_segment(segment.descriptor(), segment.header_, segment.view_.offsets);
  if (!wrong.empty())
    throw SegmentError(segment_called(name) + " cannot be attached (" + segment.path_ +
                       "): " + wrong +
                       ". Start its backend again with this o80, or remove it with `o80 clean " +
                       std::string(name) + "`.");
  if (access == Access::read_write && !segment.open_commands(reason)) return std::nullopt;
  segment.map();
  return segment;
}

AttachedSegment AttachedSegment::attach(const OwnedSegment& owner) {
  owner.check_process();
  AttachedSegment segment;
  segment.name_ = owner.name();
  segment.access_ = Access::read_write;
  segment.file_ = owner.open_segment_again(O_RDONLY);
  segment.commands_ = owner.open_commands_again(O_RDWR);
  if (!segment.file_.is_open() || !segment.commands_.is_open())
    throw SegmentError(segment_called(segment.name_) +
                       " cannot be opened again: " + std::strerror(errno));
  segment.header_ = owner.view().header();
  segment.view_.offsets = owner.view().offsets;
  segment.map();
  return segment;
}

/// Maps the open files: all for reading, with Access::read_write the bell for writing.
void AttachedSegment::map() {
  mapping_ = Mapping(descriptor(), view_.offsets.file_bytes, Mapping::Protection::read,
                     Mapping::Faults::later);
  view_.base = mapping_.data();
  view_.shape = header_.shape;
  if (access_ == Access::read_write) map_commands();
}

/// False, with a reason, if the file is missing: the segment was replaced or is being removed.
bool AttachedSegment::open_commands(std::string& reason) {
  const std::string path = commands_path(name_, header_.epoch);
  commands_ = LockFile::open(path, O_RDWR | O_NOFOLLOW);
  if (!commands_.is_open() && errno == ENOENT) {
    reason = "its commanders' file (" + path +
             ") is missing: its backend was replaced, or the file was removed";
    return false;
  }
  if (!commands_.is_open() && (errno == EACCES || errno == EPERM))
    throw ReadOnly(segment_called(name_) +
                   " cannot be commanded by this user: attach read-only to observe it, or start "
                   "its backend with --permission 660, which lets its group command it");
  if (!commands_.is_open())
    throw SegmentError("the commanders' file of " + segment_called(name_) + " cannot be opened (" +
                       path + "): " + std::strerror(errno));
  const std::string wrong =
      inspect_commands(commands_.descriptor(), descriptor(), header_, view_.offsets);
  if (!wrong.empty())
    throw SegmentError("the commanders' file of " + segment_called(name_) + " cannot be used (" +
                       path + "): " + wrong + ". Start its backend again.");
  return true;
}

/// Maps the whole file for reading, and the bell for writing.
void AttachedSegment::map_commands() {
  commands_mapping_ = Mapping(commands_.descriptor(), view_.offsets.commands_bytes,
                              Mapping::Protection::read, Mapping::Faults::later);
  view_.commands = commands_mapping_.data();
  Mapping::make_writable(view_.commands, commands_.descriptor(), view_.offsets.bell,
                         view_.shape.page_bytes);
}

AttachedSegment AttachedSegment::attach(std::string_view name, Access access,
                                        const Deadline& deadline, const AttachOptions& options) {
  const std::string path = segment_path(name);
  std::optional<AttachedSegment> found;
  std::string reason;  // why `found` does not fit
  const auto fits = [&] {
    if (!found || !is_path_of(path, found->descriptor())) found = open(name, access, reason);
    if (!found) return false;
    const Life life = found->life();
    if (life == Life::running) return true;
    if (life == Life::starting && options.starting) return true;
    if (life == Life::starting) {
      reason = starting_text(*found);
      return false;
    }
    if (options.dead) return true;
    if (life == Life::failed) found->throw_gone(life);
    reason = std::string("its last backend was ") + name_of(life) +
             ", and no new one has started. Start it again; until then its history can be read";
    return false;
  };
  for (int polls = 0;; ++polls) {
    if (fits()) return *std::move(found);
    if (deadline.over())
      throw TimeoutError(segment_called(name) + " has no running backend" +
                         (polls == 0 ? ": " : " within the time given: ") + reason +
                         (found ? "" : ". " + other_segments(name)) + ".");
    if (polls % kPollsBetweenChecks == 0 && options.keep_waiting && !options.keep_waiting())
      throw Cancelled("the wait for " + segment_called(name) + " was cancelled");
    usleep(static_cast<useconds_t>(std::max<std::int64_t>(deadline.left(kPoll) / 1000, 1)));
  }
}

AttachedSegment::AttachedSegment(AttachedSegment&& other) noexcept { *this = std::move(other); }

AttachedSegment& AttachedSegment::operator=(AttachedSegment&& other) noexcept {
  if (this == &other) return *this;
  name_ = std::move(other.name_);
  path_ = std::move(other.path_);
  access_ = other.access_;
  header_ = other.header_;
  file_ = std::move(other.file_);
  commands_ = std::move(other.commands_);
  mapping_ = std::move(other.mapping_);
  commands_mapping_ = std::move(other.commands_mapping_);
  view_ = other.view_;
  guard_ = other.guard_;
  queried_.store(0, std::memory_order_relaxed);
  over_.store(other.over_.load(std::memory_order_relaxed), std::memory_order_relaxed);
  return *this;
}

std::span<const std::byte> AttachedSegment::schema() const noexcept {
  return {view_.base + view_.offsets.schema, view_.shape.schema_bytes};
}

std::span<const std::byte> AttachedSegment::provenance() const noexcept {
  return {view_.base + view_.offsets.provenance, view_.shape.provenance_bytes};
}

Life AttachedSegment::life() const noexcept {
  // only observers query the segment file: they can place many read locks on it, which would slow
  // the query of a commander
  const int held = access_ == Access::read_write ? commands_descriptor() : descriptor();
  const Life now = life_of(held, view_.counters().state);
  if (is_over(now)) {
    over_.store(static_cast<std::uint32_t>(now), std::memory_order_relaxed);
    return now;
  }
  const auto over = static_cast<Life>(over_.load(std::memory_order_relaxed));
  return is_over(over) ? over : now;
}

bool AttachedSegment::has_ended() const noexcept {
  const auto state = static_cast<BackendState>(
      view_.counters().state.load(std::memory_order_acquire));  // sync state
  return state != BackendState::starting && state != BackendState::running;
}

bool AttachedSegment::gone() const noexcept { return is_over(life()); }

std::string AttachedSegment::fault() const {
  return load_text(view_.counters().fault, std::size(view_.counters().fault));
}

void AttachedSegment::throw_if_gone() const {
  check_process();
  throw_gone(life());
}

void AttachedSegment::throw_gone(Life life) const {
  // called in every burst: no text is built unless it is thrown
  const auto backend = [&] {
    return segment_called(name_) + ": its backend (pid " + std::to_string(header_.pid) + ") ";
  };
  constexpr const char* cure = " Its history can still be read; start it again and attach again.";
  switch (life) {
    case Life::starting:
    case Life::running:
    case Life::unknown:
      return;
    case Life::stopped:
      throw BackendStopped(backend() + "has stopped." + cure);
    case Life::failed: {
      const std::string why = fault();
      throw BackendFailed(backend() + "failed" + (why.empty() ? "." : ": " + why + ".") + cure);
    }
    case Life::superseded:
      throw BackendSuperseded(backend() +
                              "is gone and a new one has its name: attach again, in Python with "
                              "reattach(). The old history "
                              "can still be read.");
    case Life::killed:
      throw BackendKilled(backend() + "was killed." + cure);
  }
}

void AttachedSegment::throw_if_known_gone() const {
  const std::int64_t now = monotonic_roughly_now();
  const bool fresh = now - queried_.load(std::memory_order_relaxed) < kKnownFor;
  const bool ended =
      has_ended() || is_over(static_cast<Life>(over_.load(std::memory_order_relaxed)));
  if (fresh && !ended) return check_process();
  throw_if_gone();
  queried_.store(now, std::memory_order_relaxed);
}

void AttachedSegment::check_process() const {
  if (guard_.forked()) guard_.check(segment_called(name_));
}

LockFile AttachedSegment::open_commands_again() const {
  check_process();
  LockFile file = open_again(commands_, O_RDWR);
  if (!file.is_open())
    throw SegmentError(segment_called(name_) + " cannot be opened again: " + std::strerror(errno));
  return file;
}

}  // namespace o80
