#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace o80 {

// A segment is two files. Each part begins on a page of its own.
//
// The segment file is all that observers open. It has no word that anybody sleeps on:
//
//   SegmentHeader   written once, before the file has a name
//   schema          the same
//   Counters        written by the backend
//   history         slots of row_bytes: written by the backend
//
// The commanders' file belongs to one epoch of a segment. Only users who may command can open it:
//
//   CommandsHeader  written once, before the segment has a name
//   Wakes           written by the backend
//   Bell            written by every commanding frontend
//   lanes           a LaneSenderPage and its transport blocks each: written by the lane's owner
//   feedback        a LaneFeedback and its StatusSlots each: written by the backend

inline constexpr std::uint64_t kSegmentMagic = 0x0a67'6573'2030'386fULL;   // "o80 seg\n"
inline constexpr std::uint64_t kCommandsMagic = 0x0a64'6d63'2030'386fULL;  // "o80 cmd\n"
inline constexpr std::uint32_t kSegmentVersion = 3;                        // of both files
inline constexpr std::size_t kLineBytes = 64;                              // of a cache
inline constexpr std::size_t kBlockSize = 64;                              // of a lane [B]
inline constexpr std::size_t kMessages = 64;                               // kept for a lane
inline constexpr std::size_t kBurstsKept = 256;                            // for a lane
inline constexpr std::size_t kHaltsKept = 8;                               // whose reasons are kept
inline constexpr std::size_t kMostRunning = 8;                 // requests that run at a time
inline constexpr std::uint32_t kMostLanes = 256;               // a status names a lane in 8 bits
inline constexpr std::uint64_t kMostSkippedIds = 1ULL << 28;   // by the owners of a lane
inline constexpr std::uint64_t kMostUnmetOwners = 1ULL << 20;  // of a lane, between two looks at it

inline constexpr std::size_t kCancelsKept = 7;  // for a lane

/// The numbers from which every offset in both files follows.
struct SegmentShape {
  std::uint64_t page_bytes;
  std::uint64_t schema_bytes;
  std::uint64_t row_bytes;  // multiple of 8
  std::uint64_t slots;      // history promised + 1
  std::uint32_t lanes;
  std::uint32_t lane_blocks;  // power of two
};

struct SegmentHeader {
  std::uint64_t magic;
  std::uint32_t version;
  std::uint32_t header_bytes;
  SegmentShape shape;
  std::uint64_t file_bytes;     // of the segment file
  std::uint64_t epoch;          // random, never 0
  std::int64_t started_at;      // [s] since 1970
  std::uint64_t process_start;  // with `pid`, names the process that `o80 stop` signals
  std::int32_t pid;
  std::uint32_t reserved;
  char user[32];
  char program[64];
};
static_assert(sizeof(SegmentHeader) == 192);

/// Who asked for a halt, and why.
struct HaltSlot {
  alignas(kLineBytes) std::atomic<std::uint64_t> number;  // 0: unused, or being written
  std::atomic<std::int64_t> iteration;                    // in which it began to act
  std::atomic<std::uint32_t> cause;                       // a HaltCause
  std::atomic<std::uint64_t> who[8];                      // text
  std::atomic<std::uint64_t> text[31];
};

/// A request that the driver serves over several iterations.
struct RunningSlot {
  alignas(kLineBytes) std::atomic<std::uint64_t> number;  // 0: unused, or being written
  std::atomic<std::uint64_t> id;                          // within its lane
  std::atomic<std::int64_t> since;                        // iteration in which it was taken
  std::atomic<std::uint32_t> lane;
  std::atomic<std::uint32_t> request;       // its place in the schema
  std::atomic<std::uint64_t> who[8];        // text: the process that sent it
  std::atomic<std::uint64_t> progress[31];  // text
};

struct Counters {
  alignas(kLineBytes) std::atomic<std::int64_t> begun;  // row being written, or published
  std::atomic<std::int64_t> published;                  // newest row, -1 before the first
  alignas(kLineBytes) std::atomic<std::uint32_t> state;
  alignas(kLineBytes) std::atomic<std::uint64_t> fault[128];  // text
  alignas(kLineBytes) std::atomic<std::uint64_t> halted;      // number of the halt that acts, or 0
  std::atomic<std::uint64_t> cleared;    // halts asked for when the last one was cleared
  std::atomic<std::uint32_t> acts;       // 1: commands, control or a motion act at the moment
  std::atomic<std::uint64_t> verb;       // calls of driver verbs << 8 | the one under way, or 0
  std::atomic<std::uint64_t> slow_verb;  // `verb` as the helper thread has seen it before
  std::atomic<std::int64_t> slow_since;  // and since when [ns]
  HaltSlot halt;                         // the halt that acts
  RunningSlot running[kMostRunning];
};
static_assert(sizeof(HaltSlot) == 6 * kLineBytes);
static_assert(sizeof(RunningSlot) == 6 * kLineBytes);
static_assert(sizeof(Counters) ==
              3 * kLineBytes + 1024 + sizeof(HaltSlot) + kMostRunning * sizeof(RunningSlot));

struct CommandsHeader {
  std::uint64_t magic;
  std::uint32_t version;
  std::uint32_t header_bytes;
  std::uint64_t file_bytes;  // of the commanders' file
  std::uint64_t epoch;       // of the segment it belongs to
};
static_assert(sizeof(CommandsHeader) == 32);

/// What sleeping frontends and the sleeping backend need; the sleepers on `rung` are the backend's.
struct Wakes {
  alignas(kLineBytes) std::atomic<std::uint32_t> row_wake;  // futex of those who wait for a row
  std::atomic<std::uint32_t> lane_wake;                     // and for something of their lane
  alignas(kLineBytes) std::atomic<std::uint32_t> sleeping;  // the backend sleeps at the bell
};
static_assert(sizeof(Wakes) == 2 * kLineBytes);

struct Bell {
  alignas(kLineBytes) std::atomic<std::uint32_t> rung;     // futex; changes after each commit
  alignas(kLineBytes) std::atomic<std::uint64_t> tickets;  // next to be drawn
  alignas(kLineBytes) std::atomic<std::int64_t> wanted;    // lowest row anybody waits for
  std::atomic<std::uint32_t> passed_on;                    // last row_wake told to the rest
  alignas(kLineBytes) std::atomic<std::uint64_t> halts;    // asked for so far: each has its number
  HaltSlot reasons[kHaltsKept];                            // of halt n in slot n modulo their count
};
static_assert(sizeof(Bell) == 4 * kLineBytes + kHaltsKept * sizeof(HaltSlot));

/// What the owner of a lane writes; its transport blocks begin on the next page.
struct LaneSenderPage {
  alignas(kLineBytes) std::atomic<std::uint64_t> committed;    // blocks, ever
  alignas(kLineBytes) std::atomic<std::uint64_t> incarnation;  // owners so far; 0: never owned
  std::atomic<std::uint64_t> closed;                           // last one that left in order
  std::atomic<std::uint64_t> dead_incarnation;  // last one that its successor found dead
  std::atomic<std::uint64_t> successor_begin;   // blocks committed before that successor
  std::atomic<std::uint64_t> owner_begin;       // blocks committed before the present owner
  alignas(kLineBytes) std::atomic<std::uint64_t> next_id;
  std::atomic<std::int64_t> life;  // newest row that the owner knew when it last showed life
  alignas(kLineBytes) std::atomic<std::uint32_t> waiting;   // somebody sleeps until `events` moves
  alignas(kLineBytes) std::atomic<std::uint64_t> owner[8];  // text
  alignas(kLineBytes) std::atomic<std::uint64_t> cancels;   // of bursts, ever
  std::atomic<std::uint64_t> cancelled[kCancelsKept];       // the newest: ids of their batches
};
static_assert(sizeof(LaneSenderPage) == 6 * kLineBytes);

struct BurstSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::int64_t> row;  // of its last iteration, plus kCutBurst if it was cut
};

/// Whether a burst ran all of its iterations.
enum class BurstEnd : std::uint8_t { done, cut };
inline constexpr std::int64_t kCutBurst = std::int64_t{1} << 62;

struct MessageSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::uint64_t> text[31];
};
static_assert(sizeof(MessageSlot) == 256);

struct StatusSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::uint64_t> word;  // iteration 48 bit, status 4, reason 4, detail 8
};
static_assert(sizeof(StatusSlot) == 16);

/// What the backend says to a lane; its statuses begin on the next page after it.
struct LaneFeedback {
  // one line, so that whoever spins on it gets all of it in one transfer
  alignas(kLineBytes) std::atomic<std::uint64_t> freed;  // blocks, ever
  BurstSlot burst;                                       // the newest
  std::atomic<std::uint64_t> bursts;                     // done, ever
  std::atomic<std::uint32_t> events;                     // changes at each flush
  alignas(kLineBytes) std::atomic<std::uint64_t> ids;    // all below belong to batches taken
  std::atomic<std::uint64_t> incarnation;                // the last owner that the backend met
  alignas(kLineBytes) BurstSlot recent_bursts[kBurstsKept];
  MessageSlot messages[kMessages];
};
static_assert(sizeof(LaneFeedback) == 2 * kLineBytes + kBurstsKept * 16 + kMessages * 256);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

/// What an owner of a lane wrote about itself, if that can be: owners are counted one by one, and
/// the backend meets them now and then. Anything else is as if it had written nothing. So no owner
/// can use up the count, or turn it back, for the owners after it.
constexpr std::uint64_t possible_incarnation(std::uint64_t written, std::uint64_t met) noexcept {
  return written - met <= kMostUnmetOwners ? written : met;
}

/// Where the parts lie, all computed from the shape: no offset is read from a file.
struct SegmentOffsets {
  // in the segment file
  std::uint64_t schema, counters, history, file_bytes;
  // in the commanders' file
  std::uint64_t wakes, bell, lanes, lane_stride, transport, feedback, feedback_stride, statuses,
      commands_bytes;

  /// False if the shape is nonsense or a file would not fit 2^47 bytes.
  static bool compute(const SegmentShape& shape, SegmentOffsets& offsets) noexcept;
};

/// Both mapped files with names on their parts; plain pointers, valid while they are mapped.
struct SegmentView {
  std::byte* base = nullptr;      // of the segment file
  std::byte* commands = nullptr;  // of the commanders' file; null for an observer
  SegmentShape shape{};
  SegmentOffsets offsets{};

  const SegmentHeader& header() const noexcept { return at<SegmentHeader>(base, 0); }
  Counters& counters() const noexcept { return at<Counters>(base, offsets.counters); }
  std::byte* history() const noexcept { return base + offsets.history; }

  // only if the commanders' file is mapped
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
