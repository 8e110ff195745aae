#pragma once

#include <cstdint>

#include "control/batch/chunk.hpp"
#include "control/motion/state_layout.hpp"
#include "control/motion/velocity_change.hpp"
#include "control/receiving/pool.hpp"
#include "o80/control/status.hpp"

namespace o80 {

inline ChunkHead& chunk_of(BlockPool& pool, BlockIndex group) noexcept {
  return *reinterpret_cast<ChunkHead*>(pool.bytes(pool.next(group)));
}

/// The rows of a member of a chunk, in the pool.
///
/// Realtime: yes; finding a row visits a few blocks, whatever their number.
class ChunkRows {
 public:
  ChunkRows(BlockPool& pool, BlockIndex member, const StateLayout& layout) noexcept;

  std::uint32_t count() const noexcept { return rows_; }
  /// Iterations from the anchor to where a row is due.
  std::uint32_t due(std::uint32_t row) const noexcept {
    return note(row / RowNote::kRows).due[row % RowNote::kRows];
  }
  /// The first row that is due so many iterations after the anchor or later; count(): none.
  std::uint32_t first_due_from(std::int64_t iterations) const noexcept;
  /// At a row; it reads to the last one.
  Cursor cursor(std::uint32_t row) const noexcept;
  /// Calls visit(number, range) with the range of the values of each number from a row on.
  /// `scratch`: space for a row.
  template <class Visit>
  void ranges_from(std::uint32_t row, std::byte* scratch, Visit&& visit) const noexcept {
    const std::uint32_t next = row / RowNote::kRows + 1;
    if (next < places_.notes) {
      Ranges behind = ranges(next);
      for (std::uint32_t i = 0; i < layout_.numbers().size(); ++i) visit(i, behind.next());
    }
    Cursor rows = cursor(row);
    for (; row < rows_ && row < next * RowNote::kRows; ++row) {
      rows.read(scratch, places_.size);
      for (std::uint32_t i = 0; i < layout_.numbers().size(); ++i) {
        const double value = layout_.number(i, scratch);
        visit(i, Span{value, value});
      }
    }
  }

  /// The part of the check that fills notes and lists: advance() until it is done.
  struct Notes {
    std::uint32_t walked = 0;      // blocks from the head to the rows
    BlockIndex at = kNoBlock;      // the last one
    std::int64_t due = 0;          // of the row before
    std::uint32_t row = 0;         // rows whose values are noted
    std::uint32_t not_joined = 0;  // notes whose ranges reach only to the next note
  };
  /// Walks one block further towards the rows; false if rows are not due one after the other.
  bool walk(Notes& notes) noexcept;
  bool is_walked(const Notes& notes) const noexcept {
    return notes.walked == places_.blocks_before_rows();
  }
  /// The work of add(), and half of that of join() [blocks].
  std::uint32_t blocks_of_ranges() const noexcept { return places_.blocks_of_note; }
  /// Notes the values of the next row, whose first byte is at `at`.
  void add(Notes& notes, const Cursor& at, const std::byte* row) noexcept;
  /// Then, once for each note: extends the ranges of the last one that is left by the next one's.
  void join(Notes& notes) noexcept;

 private:
  BlockIndex listed(BlockIndex list, std::uint32_t i) const noexcept {
    return reinterpret_cast<const BlockIndex*>(pool_.bytes(list))[i];
  }
  void put(BlockIndex list, std::uint32_t i, BlockIndex block) noexcept {
    reinterpret_cast<BlockIndex*>(pool_.bytes(list))[i] = block;
  }
  BlockIndex block_of(std::uint32_t note) const noexcept {
    return listed(listed(lists_, note / ChunkPlaces::kListed), note % ChunkPlaces::kListed);
  }
  RowNote& note(std::uint32_t i) const noexcept {
    return *reinterpret_cast<RowNote*>(pool_.bytes(block_of(i)));
  }
  /// The ranges of a note, one number after the other.
  class Ranges {
   public:
    Ranges(BlockPool& pool, BlockIndex note) noexcept : pool_(pool), block_(note) {}
    Span& next() noexcept {
      const std::uint32_t number = number_++;
      if (number == 0) return reinterpret_cast<RowNote*>(pool_.bytes(block_))->range;
      const std::uint32_t place = (number - 1) % ChunkPlaces::kRanges;
      if (place == 0) block_ = pool_.next(block_);
      return reinterpret_cast<Span*>(pool_.bytes(block_))[place];
    }

   private:
    BlockPool& pool_;
    BlockIndex block_;
    std::uint32_t number_ = 0;
  };
  Ranges ranges(std::uint32_t of_note) const noexcept { return {pool_, block_of(of_note)}; }

  BlockPool& pool_;
  BlockIndex member_;
  const StateLayout& layout_;
  std::uint32_t rows_;
  ChunkPlaces places_;
  BlockIndex lists_;  // the block that lists the lists
};

/// True if a chunk may be taken by any backend.
bool is_valid(const ChunkHead& chunk) noexcept;

/// What the actuators of a chunk do when it is taken.
struct ChunkSurroundings {
  Iteration now = 0;          // the iteration that takes it
  Iteration acted_last = -1;  // the last one in which any of them had a command or braked
  bool stand = false;         // none of them has a command, and no chunk waits
};
/// Decides when a chunk begins; Reason::late if all its rows are, or if its
/// actuators stood still for too long after its anchor: the shift does not fit a status.
Reason judge(ChunkHead& chunk, const ChunkRows& rows, const ChunkSurroundings& at) noexcept;

}  // namespace o80
