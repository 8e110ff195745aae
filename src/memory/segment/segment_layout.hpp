#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace o80 {

// A segment is two files. Each part begins on a page of its own.
//
// Observers open the segment file only. It contains no futex word:
//
//   SegmentHeader   written once, before the file gets its name
//   schema          written once, before the file gets its name
//   provenance      likewise (runtime/journal/provenance_bytes.hpp)
//   Counters        written by the backend
//   history         slots of row_bytes: written by the backend
//   journal         a ring of entries (memory/ring/journal.hpp): written by the backend
//
// The commanders' file belongs to one epoch of a segment. Only users who may command can open it:
//
//   CommandsHeader  written once, before the segment gets its name
//   Wakes           written by the backend
//   Bell            written by every commanding frontend
//   lanes           for each lane a LaneSenderPage and its transport blocks: written by its owner
//   feedback        for each lane a LaneFeedback and its StatusSlots: written by the backend
//
// The protocols are in src/memory/README.md; that of halts in src/runtime/README.md#halts.

inline constexpr std::uint64_t kSegmentMagic = 0x0a67'6573'2030'386fULL;   // "o80 seg\n"
inline constexpr std::uint64_t kCommandsMagic = 0x0a64'6d63'2030'386fULL;  // "o80 cmd\n"
inline constexpr std::uint32_t kSegmentVersion = 10;                       // format of both files
inline constexpr std::size_t kLineBytes = 64;       // size of a cache line [bytes]
inline constexpr std::size_t kBlockSize = 64;       // size of a block of a lane [bytes]
inline constexpr std::size_t kMessages = 64;        // status texts kept for each lane
inline constexpr std::size_t kBurstsKept = 256;     // burst results kept for each lane
inline constexpr std::size_t kCancelsKept = 7;      // cancelled bursts kept for each lane
inline constexpr std::size_t kHaltsKept = 8;        // halts whose reasons are kept
inline constexpr std::size_t kMaxRunning = 8;       // requests that run at the same time
inline constexpr std::size_t kJournalSectors = 64;  // parts of the journal with a mark each
inline constexpr std::uint32_t kMaxLanes = 256;     // a status has 8 bits for a lane
/// Most ids that the owners of a lane may skip between two batches; a larger jump is invalid.
inline constexpr std::uint64_t kMaxSkippedIds = 1ULL << 28;
/// Most owners that a lane may have between two loads of `incarnation` by the backend.
inline constexpr std::uint64_t kMaxUnmetOwners = 1ULL << 20;

/// The numbers that determine all offsets in both files.
struct SegmentShape {
  std::uint64_t page_bytes;
  std::uint64_t schema_bytes;
  std::uint64_t provenance_bytes;
  std::uint64_t row_bytes;  // multiple of 8
  std::uint64_t slots;      // length of the history + 1
  std::uint32_t lanes;
  std::uint32_t lane_blocks;    // power of two
  std::uint64_t journal_bytes;  // power of two, at least kMinJournal; 0: no journal
};
inline constexpr std::uint64_t kMinJournal = 4096;  // [bytes]

/// Flag of a segment: its rows come from a recording (runtime/replay/played_segment.hpp).
inline constexpr std::uint32_t kPlayed = 1;

struct SegmentHeader {
  std::uint64_t magic;
  std::uint32_t version;
  std::uint32_t header_bytes;
  SegmentShape shape;
  std::uint64_t file_bytes;     // size of the segment file
  std::uint64_t epoch;          // random, never 0
  std::int64_t started_at;      // [s] since 1970
  std::uint64_t process_start;  // with `pid`: identifies the process, for `o80 stop`
  std::int32_t pid;
  std::uint32_t flags;
  char user[32];
  char program[64];
};
static_assert(sizeof(SegmentHeader) == 208);

/// Requester and reason of a halt.
struct HaltSlot {
  alignas(kLineBytes) std::atomic<std::uint64_t> number;  // 0: unused, or being written
  std::atomic<std::int64_t> iteration;                    // first halted iteration
  std::atomic<std::uint32_t> cause;                       // a HaltCause
  std::atomic<std::uint64_t> who[8];                      // text: the requesting process
  std::atomic<std::uint64_t> text[31];
};

/// A request that the driver serves over several iterations.
struct RunningSlot {
  alignas(kLineBytes) std::atomic<std::uint64_t> number;  // 0: unused, or being written
  std::atomic<std::uint64_t> id;                          // id within its lane
  std::atomic<std::int64_t> since;                        // iteration in which it was taken
  std::atomic<std::uint32_t> lane;
  std::atomic<std::uint32_t> request;       // index in the schema
  std::atomic<std::uint64_t> who[8];        // text: the process that sent it
  std::atomic<std::uint64_t> progress[31];  // text
};

/// Positions in the journal: bytes written since the start (memory/ring/journal.hpp).
struct JournalCounters {
  alignas(kLineBytes) std::atomic<std::uint64_t> begun;  // end of the newest entry that was begun
  std::atomic<std::uint64_t> published;                  // end of the newest whole entry
  /// For each sector: the first entry that begins in it, in the newest lap that has one.
  alignas(kLineBytes) std::atomic<std::uint64_t> marks[kJournalSectors];
};
static_assert(sizeof(JournalCounters) == kLineBytes + kJournalSectors * 8);

struct Counters {
  alignas(kLineBytes) std::atomic<std::int64_t> begun;  // newest row that was begun
  std::atomic<std::int64_t> published;                  // newest row, -1 before the first
  /// Rows before this one are missing: 0, unless a recording is played. See HistoryWriter::skip_to.
  std::atomic<std::int64_t> first;
  std::atomic<std::int64_t> next_at;    // expected time of the next row [ns]; 0: unknown
  std::atomic<std::int32_t> processor;  // of the loop when it published; valid with next_at
  alignas(kLineBytes) std::atomic<std::uint32_t> state;
  alignas(kLineBytes) std::atomic<std::uint64_t> fault[128];  // text
  alignas(kLineBytes) std::atomic<std::uint64_t> halted;      // number of the halt in force, or 0
  std::atomic<std::uint64_t> cleared;    // Bell::halts when the last halt was cleared
  std::atomic<std::uint32_t> acts;       // 1: a command, control or a motion is active
  std::atomic<std::uint64_t> verb;       // bits 8..63: driver calls; 0..7: present Verb, or 0
  std::atomic<std::uint64_t> slow_verb;  // `verb` at the last change seen by the helper thread
  std::atomic<std::int64_t> slow_since;  // time of that change [ns]
  std::atomic<std::uint64_t> queue;      // the holder of the queue: memory/segment/queue_word.hpp
  HaltSlot halt;                         // the halt in force
  RunningSlot running[kMaxRunning];
  JournalCounters journal;
};
static_assert(sizeof(HaltSlot) == 6 * kLineBytes);
static_assert(sizeof(RunningSlot) == 6 * kLineBytes);
static_assert(sizeof(Counters) == 3 * kLineBytes + 1024 + sizeof(HaltSlot) +
                                      kMaxRunning * sizeof(RunningSlot) + sizeof(JournalCounters));

struct CommandsHeader {
  std::uint64_t magic;
  std::uint32_t version;
  std::uint32_t header_bytes;
  std::uint64_t file_bytes;  // size of the commanders' file
  std::uint64_t epoch;       // of the segment it belongs to
};
static_assert(sizeof(CommandsHeader) == 32);

/// What sleeping frontends and the sleeping backend need; the sleepers on `rung` are the backend's.
struct Wakes {
  alignas(kLineBytes) std::atomic<std::uint32_t> row_wake;  // futex of readers that wait for a row
  std::atomic<std::uint32_t> lane_wake;                     // futex of senders that wait on a lane
  alignas(kLineBytes) std::atomic<std::uint32_t> sleeping;  // 1: the backend sleeps on Bell::rung
};
static_assert(sizeof(Wakes) == 2 * kLineBytes);

struct Bell {
  alignas(kLineBytes) std::atomic<std::uint32_t> rung;     // futex; changes after each commit
  alignas(kLineBytes) std::atomic<std::uint64_t> tickets;  // the next ticket
  alignas(kLineBytes) std::atomic<std::int64_t> wanted;    // lowest row that a reader waits for
  std::atomic<std::uint32_t> passed_on;                    // last row_wake that a reader passed on
  alignas(kLineBytes) std::atomic<std::uint64_t> halts;    // halts requested so far
  HaltSlot reasons[kHaltsKept];                            // halt n: slot n modulo kHaltsKept
};
static_assert(sizeof(Bell) == 4 * kLineBytes + kHaltsKept * sizeof(HaltSlot));

/// Written by the owner of a lane; its transport blocks begin on the next page.
struct LaneSenderPage {
  alignas(kLineBytes) std::atomic<std::uint64_t> committed;    // blocks committed so far
  alignas(kLineBytes) std::atomic<std::uint64_t> incarnation;  // owners so far; 0: never owned
  std::atomic<std::uint64_t> closed;            // incarnation of the last owner that closed
  std::atomic<std::uint64_t> dead_incarnation;  // last owner that its successor found dead
  std::atomic<std::uint64_t> successor_begin;   // blocks committed before that successor
  std::atomic<std::uint64_t> owner_begin;       // blocks committed before the present owner
  alignas(kLineBytes) std::atomic<std::uint64_t> next_id;
  std::atomic<std::int64_t> life;  // newest row at the last sign of life of the owner
  alignas(kLineBytes) std::atomic<std::uint32_t> waiting;   // 1: a thread waits for `events`
  alignas(kLineBytes) std::atomic<std::uint64_t> owner[8];  // text: the process of the owner
  alignas(kLineBytes) std::atomic<std::uint64_t> cancels;   // bursts cancelled so far
  std::atomic<std::uint64_t> cancelled[kCancelsKept];       // ids of the last cancelled batches
};
static_assert(sizeof(LaneSenderPage) == 6 * kLineBytes);

struct BurstSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::int64_t> row;  // last row of the burst, plus kCutBurst if it was cut
};

/// done: a burst ran all its iterations; cut: it was ended before.
enum class BurstEnd : std::uint8_t { done, cut };
inline constexpr std::int64_t kCutBurst = std::int64_t{1} << 62;

struct MessageSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::uint64_t> text[31];
};
static_assert(sizeof(MessageSlot) == 256);

struct StatusSlot {
  std::atomic<std::uint64_t> id;    // in 48 bits; above: StatusAnswer::late
  std::atomic<std::uint64_t> word;  // a StatusWord (status_word.hpp)
};
static_assert(sizeof(StatusSlot) == 16);

/// Feedback of the backend to the owner of a lane; its status slots begin on the next page.
struct LaneFeedback {
  // one cache line, so that a spinning sender gets all of it in one transfer
  alignas(kLineBytes) std::atomic<std::uint64_t> freed;  // blocks freed so far
  BurstSlot burst;                                       // the newest burst result
  std::atomic<std::uint64_t> bursts;                     // burst results so far
  std::atomic<std::uint32_t> events;                     // changes at each flush of a flagged lane
  alignas(kLineBytes) std::atomic<std::uint64_t> ids;    // all ids below belong to staged batches
  std::atomic<std::uint64_t> incarnation;                // last owner that the backend has seen
  alignas(kLineBytes) BurstSlot recent_bursts[kBurstsKept];
  MessageSlot messages[kMessages];
};
static_assert(sizeof(LaneFeedback) == 2 * kLineBytes + kBurstsKept * 16 + kMessages * 256);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

/// The incarnation that an owner has written, if it is plausible: at most kMaxUnmetOwners above
/// `met`, the last one that the backend has seen. Else `met`. So no owner can exhaust or decrease
/// the count for later owners.
constexpr std::uint64_t possible_incarnation(std::uint64_t written, std::uint64_t met) noexcept {
  return written - met <= kMaxUnmetOwners ? written : met;
}

/// Offsets of the parts, computed from the shape: no offset is read from a file.
struct SegmentOffsets {
  // in the segment file
  std::uint64_t schema, provenance, counters, history, journal, file_bytes;
  // in the commanders' file
  std::uint64_t wakes, bell, lanes, lane_stride, transport, feedback, feedback_stride, statuses,
      commands_bytes;

  /// False if the shape is invalid or too large.
  static bool compute(const SegmentShape& shape, SegmentOffsets& offsets) noexcept;
};

/// The parts of both mapped files. Plain pointers, valid while the files are mapped.
struct SegmentView {
  std::byte* base = nullptr;      // start of the segment file
  std::byte* commands = nullptr;  // start of the commanders' file; null for an observer
  SegmentShape shape{};
  SegmentOffsets offsets{};

  const SegmentHeader& header() const noexcept { return at<SegmentHeader>(base, 0); }
  Counters& counters() const noexcept { return at<Counters>(base, offsets.counters); }
  std::byte* history() const noexcept { return base + offsets.history; }
  std::byte* journal() const noexcept { return base + offsets.journal; }

  // valid only if the commanders' file is mapped
  Wakes& wakes() const noexcept { return at<Wakes>(commands, offsets.wakes); }
  Bell& bell() const noexcept { return at<Bell>(commands, offsets.bell); }
  LaneSenderPage& lane(std::uint32_t i) const noexcept {
    return at<LaneSenderPage>(commands, lane_offset(i));
  }
  std::byte* transport(std::uint32_t i) const noexcept {
    return commands + lane_offset(i) + offsets.transport;
  }
  LaneFeedback& feedback(std::uint32_t i) const noexcept {
    return at<LaneFeedback>(commands, offsets.feedback + i * offsets.feedback_stride);
  }
  StatusSlot* statuses(std::uint32_t i) const noexcept {
    return &at<StatusSlot>(commands,
                           offsets.feedback + i * offsets.feedback_stride + offsets.statuses);
  }
  std::uint64_t lane_offset(std::uint32_t i) const noexcept {
    return offsets.lanes + i * offsets.lane_stride;
  }

 private:
  template <class T>
  static T& at(std::byte* file, std::uint64_t offset) noexcept {
    return *reinterpret_cast<T*>(file + offset);
  }
};

}  // namespace o80
