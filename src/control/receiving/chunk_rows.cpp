#include "control/receiving/chunk_rows.hpp"

namespace o80 {

ChunkRows::ChunkRows(BlockPool& pool, BlockIndex member, const StateLayout& layout) noexcept
    : pool_(pool),
      member_(member),
      layout_(layout),
      rows_(pool.head(member).rows),
      places_(rows_, layout, pool.head(member).masked != 0),
      lists_(member) {
  for (std::uint32_t i = 0; i < places_.before; ++i) lists_ = pool.next(lists_);
}

std::uint32_t ChunkRows::first_due_from(std::int64_t iterations) const noexcept {
  // the last note that begins before, then the rows of it
  std::uint32_t low = 0;
  std::uint32_t high = places_.notes;
  while (high - low > 1) {
    const std::uint32_t middle = low + (high - low) / 2;
    (note(middle).due[0] < iterations ? low : high) = middle;
  }
  const RowNote& found = note(low);
  std::uint32_t row = low * RowNote::kRows;
  const std::uint32_t end = std::min(rows_, row + RowNote::kRows);
  while (row < end && found.due[row % RowNote::kRows] < iterations) ++row;
  return row;
}

Cursor ChunkRows::cursor(std::uint32_t row) const noexcept {
  const std::uint32_t first = row - row % RowNote::kRows;
  BlockIndex block = note(row / RowNote::kRows).block;
  std::uint64_t offset =
      std::uint64_t{first} * places_.size % kBlockBytes + std::uint64_t{row - first} * places_.size;
  for (; offset >= kBlockBytes; offset -= kBlockBytes) block = pool_.next(block);
  return {pool_, block, static_cast<std::uint32_t>(offset),
          std::uint64_t{rows_ - row} * places_.size};
}

bool ChunkRows::walk(Notes& notes) noexcept {
  notes.at = notes.walked == 0 ? member_ : pool_.next(notes.at);
  const std::uint32_t place = notes.walked++;
  const std::uint32_t first_list = places_.before + 1;
  if (place < first_list) return true;
  if (place < places_.blocks_before_notes()) {
    put(lists_, place - first_list, notes.at);
    return true;
  }
  const std::uint32_t behind = place - places_.blocks_before_notes();
  if (behind % places_.blocks_of_note != 0) return true;
  const std::uint32_t i = behind / places_.blocks_of_note;
  put(listed(lists_, i / ChunkPlaces::kListed), i % ChunkPlaces::kListed, notes.at);
  const std::uint32_t first = i * RowNote::kRows;
  for (std::uint32_t k = 0; k < RowNote::kRows && first + k < rows_; ++k) {
    const std::uint32_t due = note(i).due[k];
    if (due <= notes.due || due > kLatestDue) return false;
    notes.due = due;
  }
  return true;
}

void ChunkRows::add(Notes& notes, const Cursor& at, const std::byte* row) noexcept {
  const std::uint32_t i = notes.row / RowNote::kRows;
  const bool is_first = notes.row++ % RowNote::kRows == 0;
  if (is_first) {
    // a cursor at the end of a block has not gone on to the next one
    note(i).block = at.offset() < kBlockBytes ? at.block() : pool_.next(at.block());
  }
  Ranges noted = ranges(i);
  for (std::uint32_t number = 0; number < layout_.numbers().size(); ++number) {
    const double value = layout_.number(number, row);
    Span& known = noted.next();
    if (is_first) {
      known = {value, value};
    } else {
      known.include(value);
    }
  }
  notes.not_joined = i;
}

void ChunkRows::join(Notes& notes) noexcept {
  const std::uint32_t i = --notes.not_joined;
  Ranges noted = ranges(i);
  Ranges behind = ranges(i + 1);
  for (std::uint32_t number = 0; number < layout_.numbers().size(); ++number) {
    const Span& rest = behind.next();
    Span& known = noted.next();
    known.include(rest.low);
    known.include(rest.high);
  }
}

bool is_valid(const ChunkHead& chunk) noexcept {
  return chunk.rows > 0 && chunk.rows <= kMaxChunkRows && chunk.first < chunk.rows &&
         chunk.ease <= kLatestDue && chunk.fixed <= 1 && chunk.reject_late <= 1 &&
         chunk.final <= 1 && chunk.anchor >= -static_cast<Iteration>(kLatestDue) &&
         chunk.anchor <= kMaxIterations;
}

Reason judge(ChunkHead& chunk, const ChunkRows& rows, const ChunkSurroundings& at) noexcept {
  // standing still does not count: there is no motion to continue until the rows begin
  const bool stood = at.stand && chunk.fixed == 0 && at.acted_last < at.now - 1;
  const Iteration last = at.now - 1;
  chunk.shift = 0;
  chunk.stood = stood ? 1 : 0;
  if (stood && chunk.anchor < last) chunk.shift = last - std::max(at.acted_last, chunk.anchor);
  if (chunk.shift > TakenChunk::kMostShift) return Reason::late;
  const std::uint32_t first = stood ? 0 : chunk.first;
  const Iteration anchor = chunk.anchor + chunk.shift;
  const Iteration before = anchor + (first == 0 ? 0 : rows.due(first - 1));
  chunk.begins = std::max(at.now, before + 1);
  chunk.late = rows.first_due_from(at.now - anchor);
  if (chunk.late == chunk.rows) return Reason::late;
  if (chunk.reject_late != 0 && !stood && chunk.late > first) return Reason::late;
  const std::int64_t ahead = anchor + rows.due(chunk.rows - 1) - at.now;
  return ahead > kLatestDue ? Reason::invalid : Reason::none;
}

}  // namespace o80
