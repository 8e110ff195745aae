#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "memory/segment/segment_layout.hpp"
#include "o80/base/time.hpp"

namespace o80 {

/// Writes rows 0, 1, 2, ... into the ring of the history.
///
/// Writer:   one thread, wait-free.
/// Readers:  HistoryReader, any number, any process.
/// Realtime: yes.
class HistoryWriter {
 public:
  explicit HistoryWriter(const SegmentView& view) noexcept;

  /// Publishes row k, which must be one more than the last, from private memory.
  void publish(Iteration k, const std::byte* row) noexcept;
  /// The next row is k, later than the last one plus one: the rows between are missing, and the
  /// rows before them are no longer read. Until row k is published readers find no row but the
  /// latest.
  void skip_to(Iteration k) noexcept;
  /// Prefetches the cache lines that publish(k) will write.
  void expect(Iteration k) const noexcept;

 private:
  Counters* counters_;
  std::byte* slots_begin_;
  std::size_t row_bytes_;
  std::uint64_t slots_;
};

/// Reads rows by iteration. It never returns a torn row and never waits.
///
/// Writer:   HistoryWriter.
/// Readers:  const calls from any thread; a read-only mapping is enough.
/// Realtime: yes; a range takes time in proportion to its rows.
class HistoryReader {
 public:
  struct Range {
    Iteration first;    // first row
    std::size_t count;  // number of rows
  };

  /// Bytes `begin` to `begin + size - 1` of each row, and their place in a row of the result.
  struct Part {
    std::uint64_t begin;
    std::uint64_t size;
    std::uint64_t to;
  };

  explicit HistoryReader(const SegmentView& view) noexcept;

  std::size_t row_bytes() const noexcept { return row_bytes_; }
  /// Number of rows that the history keeps.
  std::uint64_t rows() const noexcept { return slots_ - 1; }
  /// The newest row; -1 before row 0.
  Iteration published() const noexcept;
  /// The oldest row that the history still holds; before the first row, that one.
  Iteration oldest() const noexcept;
  /// Copies row k; false if not published yet or overwritten.
  bool read(Iteration k, std::byte* to) const noexcept;
  /// Copies the newest row and returns its iteration; -1 if there is none or is_damaged().
  Iteration latest(std::byte* to) const noexcept;
  /// True if the counters contradict each other. Then no row is trusted.
  bool is_damaged() const noexcept;
  /// Copies those of the rows first .. first + count - 1 that the history holds, packed at the
  /// start of `to`.
  Range read_range(Iteration first, std::size_t count, std::byte* to) const noexcept;
  /// Likewise, but copies only parts of each row, which must lie within it; a row of the result has
  /// `packed` bytes.
  Range read_parts(Iteration first, std::size_t count, std::span<const Part> parts,
                   std::size_t packed, std::byte* to) const noexcept;

 private:
  /// `copy(from, rows, to)` copies adjacent slots to rows of `packed` bytes.
  template <class Copy>
  Range read_by(Iteration first, std::size_t count, std::size_t packed, std::byte* to,
                Copy copy) const noexcept;
  const std::byte* slot(Iteration k) const noexcept;
  /// The row that is being written; else the newest.
  Iteration begun() const noexcept;
  /// Rows before this one are missing.
  Iteration first_available() const noexcept;
  /// The first intact row: rows from here on that were copied before this call were not overwritten
  /// during the copy.
  Iteration first_intact() const noexcept;

  const Counters* counters_;
  const std::byte* slots_begin_;
  std::size_t row_bytes_;
  std::uint64_t slots_;
};

}  // namespace o80
