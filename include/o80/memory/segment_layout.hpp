#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace o80 {

// What stands in the file of a segment. In order, each part on pages of its own:
//
//   SegmentHeader   written once, before the file has a name
//   schema          the same
//   Counters        written by the backend
//   Bell            written by every commanding frontend
//   lanes           a LaneSenderPage and its transport blocks each: written by the lane's owner
//   feedback        a LaneFeedback and its StatusSlots each: written by the backend
//   history         slots of row_bytes: written by the backend

inline constexpr std::uint64_t kSegmentMagic = 0x0a67'6573'2030'386fULL;  // "o80 seg\n"
inline constexpr std::uint32_t kSegmentVersion = 1;
inline constexpr std::size_t kLineBytes = 64;    // of a cache
inline constexpr std::size_t kBlockSize = 64;    // of a lane [B]
inline constexpr std::size_t kMessages = 64;     // kept for a lane
inline constexpr std::size_t kBurstsKept = 256;  // for a lane
inline constexpr std::uint32_t kMostLanes = 1024;
inline constexpr std::uint64_t kIncarnations = (1ULL << 62) - 1;  // what a lane's count is cut to
inline constexpr std::uint64_t kLeap = 1ULL << 28;  // ids that a lane's owners may leave out

/// The numbers from which every offset in the file follows.
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
  std::uint64_t file_bytes;
  std::uint64_t epoch;      // random, never 0
  std::int64_t started_at;  // [s] since 1970
  std::int32_t pid;         // for messages only
  std::uint32_t reserved;
  char user[32];
  char program[64];
};
static_assert(sizeof(SegmentHeader) == 184);

struct Counters {
  alignas(kLineBytes) std::atomic<std::int64_t> begun;  // row being written, or published
  std::atomic<std::int64_t> published;                  // newest row, -1 before the first
  alignas(kLineBytes) std::atomic<std::uint32_t> state;
  std::atomic<std::uint32_t> row_wake;                        // futex of those who wait for a row
  std::atomic<std::uint32_t> lane_wake;                       // and for something of their lane
  alignas(kLineBytes) std::atomic<std::uint32_t> sleeping;    // the backend sleeps at the bell
  alignas(kLineBytes) std::atomic<std::uint64_t> fault[128];  // text
};
static_assert(sizeof(Counters) == 192 + 1024);

struct Bell {
  alignas(kLineBytes) std::atomic<std::uint32_t> rung;     // futex; changes after each commit
  alignas(kLineBytes) std::atomic<std::uint64_t> tickets;  // next to be drawn
  alignas(kLineBytes) std::atomic<std::int64_t> wanted;    // lowest row anybody waits for
  std::atomic<std::uint32_t> passed_on;                    // last row_wake told to the rest
};
static_assert(sizeof(Bell) == 3 * kLineBytes);

/// What the owner of a lane writes; its transport blocks begin on the next page.
struct LaneSenderPage {
  alignas(kLineBytes) std::atomic<std::uint64_t> committed;    // blocks, ever
  alignas(kLineBytes) std::atomic<std::uint64_t> incarnation;  // owners so far; 0: never owned
  std::atomic<std::uint64_t> closed;                           // last one that left in order
  std::atomic<std::uint64_t> began;  // blocks committed before the heir of `lost`
  std::atomic<std::uint64_t> lost;   // last one that its heir found dead
  std::atomic<std::uint64_t> first;  // blocks committed before the present owner
  alignas(kLineBytes) std::atomic<std::uint64_t> next_id;
  alignas(kLineBytes) std::atomic<std::uint32_t> waiting;   // somebody sleeps until `events` moves
  alignas(kLineBytes) std::atomic<std::uint64_t> owner[8];  // text
};
static_assert(sizeof(LaneSenderPage) == 5 * kLineBytes);

struct BurstSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::int64_t> row;
};

struct MessageSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::uint64_t> text[31];
};
static_assert(sizeof(MessageSlot) == 256);

struct StatusSlot {
  std::atomic<std::uint64_t> id;
  std::atomic<std::uint64_t> word;  // iteration 48 bit, status 4, reason 4, aux 8
};
static_assert(sizeof(StatusSlot) == 16);

/// What the backend says to a lane; its statuses begin on the next page after it.
struct LaneFeedback {
  // one line, so that whoever spins on it gets all of it in one transfer
  alignas(kLineBytes) std::atomic<std::uint64_t> freed;   // blocks, ever
  std::atomic<std::uint64_t> ended;                       // last batch whose commands have ended
  BurstSlot burst;                                        // the newest
  std::atomic<std::uint64_t> bursts;                      // done, ever
  std::atomic<std::uint32_t> events;                      // changes at each flush
  alignas(kLineBytes) std::atomic<std::uint64_t> staged;  // last batch staged whole
  std::atomic<std::uint64_t> ids;                         // all below belong to batches taken
  alignas(kLineBytes) BurstSlot recent_bursts[kBurstsKept];
  MessageSlot messages[kMessages];
};
static_assert(sizeof(LaneFeedback) == 2 * kLineBytes + kBurstsKept * 16 + kMessages * 256);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
              std::atomic<std::uint32_t>::is_always_lock_free);

/// Where the parts lie, all computed from the shape: no offset in the file can lie.
struct SegmentOffsets {
  std::uint64_t schema, counters, bell, lanes, lane_stride, transport, feedback, feedback_stride,
      statuses, history, file_bytes;

  /// False if the shape is nonsense or does not fit 2^47 bytes.
  static bool compute(const SegmentShape& shape, SegmentOffsets& offsets) noexcept;
};

/// The mapped file with names on its parts; a plain pointer, valid while the segment is mapped.
struct SegmentView {
  std::byte* base = nullptr;
  SegmentShape shape{};
  SegmentOffsets offsets{};

  template <class T>
  T& at(std::uint64_t offset) const noexcept {
    return *reinterpret_cast<T*>(base + offset);
  }
  const SegmentHeader& header() const noexcept { return at<SegmentHeader>(0); }
  Counters& counters() const noexcept { return at<Counters>(offsets.counters); }
  Bell& bell() const noexcept { return at<Bell>(offsets.bell); }
  LaneSenderPage& lane(std::uint32_t i) const noexcept {
    return at<LaneSenderPage>(offsets.lanes + i * offsets.lane_stride);
  }
  std::byte* transport(std::uint32_t i) const noexcept {
    return base + offsets.lanes + i * offsets.lane_stride + offsets.transport;
  }
  LaneFeedback& feedback(std::uint32_t i) const noexcept {
    return at<LaneFeedback>(offsets.feedback + i * offsets.feedback_stride);
  }
  StatusSlot* statuses(std::uint32_t i) const noexcept {
    return &at<StatusSlot>(offsets.feedback + i * offsets.feedback_stride + offsets.statuses);
  }
  std::byte* history() const noexcept { return base + offsets.history; }
};

}  // namespace o80
