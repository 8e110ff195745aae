#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "control/batch/record.hpp"
#include "control/motion/state_layout.hpp"
#include "control/motion/velocity_change.hpp"

namespace o80 {

/// Most rows of a chunk.
inline constexpr std::uint32_t kMaxChunkRows = 2048;
/// The latest due iteration, from the anchor on.
inline constexpr std::uint32_t kLatestDue = std::uint32_t{1} << 31;

/// The second block of the group record of a chunk (docs/chunks.md). Its members have pace `chunk`.
struct ChunkHead {
  std::uint64_t epoch = 0;
  Iteration anchor = 0;
  std::uint64_t plan = 0;  // of one plan of a lane, an older anchor is rejected
  std::uint32_t rows = 0;
  std::uint32_t ease = 1;   // iterations of the take-over; 0: those that first_row() chooses
  std::uint32_t first = 0;  // rows before it are not played
  std::uint8_t fixed = 0;
  std::uint8_t reject_late = 0;
  std::uint8_t stood = 0;  // by judge(): whether its actuators stood still
  std::uint8_t final = 0;  // the last chunk of its plan; by a record close_plan too
  // for the backend, by judge() and first_row(); values from a frontend are ignored
  std::int64_t shift = 0;  // rows are due so much later, because the actuators stood still
  Iteration begins = 0;
  std::uint32_t late = 0;  // rows that were due before it was taken
  std::uint32_t row = 0;   // the first row that is reached
};
static_assert(sizeof(ChunkHead) == kBlockBytes);
/// A group record of a chunk: the state of the group, and ChunkHead.
inline constexpr std::uint32_t kChunkGroupBytes =
    kBlockBytes - sizeof(RecordHead) + sizeof(ChunkHead);

/// True for the group record of a chunk, and for its members.
inline bool is_chunk(const RecordHead& head) noexcept { return head.pace == Pace::chunk; }

/// A note about kRows rows of a member: where they are, when they are due, and between which values
/// each number stays from there to the last row.
///
/// The sender leaves room for the notes before the rows. So reading a few blocks finds a row,
/// however many rows there are.
struct RowNote {
  static constexpr std::uint32_t kRows = 8;
  BlockIndex block = kNoBlock;  // of the first of these rows
  std::uint32_t unused = 0;
  std::array<std::uint32_t, kRows> due{};  // iterations after the anchor, rising; by the sender
  std::uint64_t unused_too = 0;
  Span range;  // of the first number; those of the others are in the next blocks
};
static_assert(sizeof(RowNote) == kBlockBytes);

/// The parts of a member, each from a new block on: head and mask; one block that says where the
/// lists are; the lists, which say where the notes are; the notes; the rows.
struct ChunkPlaces {
  static constexpr std::uint32_t kListed = kBlockBytes / sizeof(BlockIndex);
  static constexpr std::uint32_t kRanges = kBlockBytes / sizeof(Span);

  /// masked: whether a mask comes before.
  ChunkPlaces(std::uint32_t rows, const StateLayout& layout, bool masked) noexcept
      : ChunkPlaces(rows, layout.size(), static_cast<std::uint32_t>(layout.numbers().size()),
                    masked) {}
  /// The states have so many bytes and numbers.
  ChunkPlaces(std::uint32_t rows, std::uint32_t bytes, std::uint32_t numbers, bool masked) noexcept
      : size(bytes),
        before(static_cast<std::uint32_t>(blocks_of(masked ? 8 * mask_words(numbers) : 0))),
        notes((rows + RowNote::kRows - 1) / RowNote::kRows),
        lists((notes + kListed - 1) / kListed),
        blocks_of_note(1 + (numbers + kRanges - 2) / kRanges),
        payload_bytes(std::uint64_t{blocks_before_rows()} * kBlockBytes - sizeof(RecordHead) +
                      std::uint64_t{rows} * size) {}
  std::uint32_t blocks_before_notes() const noexcept { return before + 1 + lists; }
  std::uint32_t blocks_before_rows() const noexcept {
    return blocks_before_notes() + notes * blocks_of_note;
  }

  std::uint32_t size;            // of a row [bytes]
  std::uint32_t before;          // blocks
  std::uint32_t notes;           // one for RowNote::kRows rows
  std::uint32_t lists;           // blocks
  std::uint32_t blocks_of_note;  // blocks
  std::uint64_t payload_bytes;
};

/// The active status of the batch of a chunk that was taken: the shift in its delay and
/// in 6 bits of its detail. A bit tells this status from the one before, of the batch alone.
struct TakenChunk {
  static constexpr std::int64_t kMostShift = (std::int64_t{1} << 22) - 1;

  std::int64_t shift = 0;
  bool stood = false;

  std::uint8_t detail() const noexcept {
    return static_cast<std::uint8_t>(shift >> 16 | (stood ? 0x80 : 0) | kIsTaken);
  }
  /// Nothing if it was not taken yet.
  static std::optional<TakenChunk> of(std::uint8_t detail, std::int64_t late) noexcept {
    if ((detail & kIsTaken) == 0) return std::nullopt;
    return TakenChunk{static_cast<std::int64_t>(detail & 0x3F) << 16 | late, (detail & 0x80) != 0};
  }

 private:
  static constexpr std::uint8_t kIsTaken = 0x40;
};
/// The status of the end of the batch of a chunk that has begun, in 16 bits of the delay
/// and 7 of the detail.
struct BegunChunk {
  static constexpr std::int64_t kMostNeeded = 4095;

  std::uint32_t row = 0;    // the first row that is reached
  std::int64_t needed = 0;  // iterations that limits need for the take-over, if it has fewer

  std::uint8_t detail() const noexcept { return static_cast<std::uint8_t>(packed() >> 16 | 0x80); }
  std::uint16_t late() const noexcept { return static_cast<std::uint16_t>(packed()); }
  /// Nothing if it has not begun yet.
  static std::optional<BegunChunk> of(std::uint8_t detail, std::int64_t late) noexcept {
    if ((detail & 0x80) == 0) return std::nullopt;
    const std::uint32_t packed = (detail & 0x7FU) << 16 | static_cast<std::uint32_t>(late);
    return BegunChunk{packed % kMaxChunkRows, packed / kMaxChunkRows};
  }

 private:
  std::uint32_t packed() const noexcept {
    return static_cast<std::uint32_t>(std::min(needed, kMostNeeded)) * kMaxChunkRows + row;
  }
};
static_assert(kMaxChunkRows * (BegunChunk::kMostNeeded + 1) == 1 << 23);

/// The row to which a chunk takes over when it begins, so many iterations after its anchor. `ease`:
/// iterations of the take-over; 0: those that limits need, at least a step and at most half of
/// those that are ahead. `needed(row, n)`: how many limits need to a row that is n iterations away.
template <class Rows, class Needed>
BegunChunk first_row(const Rows& rows, std::int64_t begins, std::int64_t ease,
                     Needed&& needed) noexcept {
  const std::uint32_t last = rows.count() - 1;
  const auto row_from = [&](std::int64_t iterations) {
    return std::min(rows.first_due_from(begins + iterations - 1), last);
  };
  const auto way = [&](std::uint32_t row) {
    return std::max<std::int64_t>(1, std::int64_t{rows.due(row)} - begins + 1);
  };
  const auto whole = [](double iterations) {
    return static_cast<std::int64_t>(std::ceil(std::min(iterations, double{kLatestDue})));
  };
  std::int64_t fewest = 0;
  if (ease == 0) {
    const std::int64_t step = last == 0 ? 1 : (rows.due(last) - rows.due(0) + last - 1) / last;
    const std::uint32_t row = row_from(step);
    fewest = std::max(step, whole(needed(row, way(row))));
    ease = std::clamp<std::int64_t>(fewest, 1, std::max<std::int64_t>(1, way(last) / 2));
  }
  const std::uint32_t row = row_from(ease);
  const std::int64_t has = std::max(way(row), ease);
  if (fewest == 0) fewest = whole(needed(row, has));
  return {row, fewest > has ? fewest : 0};
}

}  // namespace o80
