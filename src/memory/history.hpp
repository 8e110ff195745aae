#pragma once

#include <cstddef>
#include <cstdint>

#include "memory/segment_layout.hpp"
#include "o80/base/time.hpp"

namespace o80 {

/// Puts rows into the ring, 0, 1, 2, ...
///
/// Writer:   one thread, wait-free.
/// Readers:  HistoryReader, any number, any process.
/// Realtime: yes.
class HistoryWriter {
 public:
  explicit HistoryWriter(const SegmentView& view) noexcept;

  std::size_t row_bytes() const noexcept { return row_bytes_; }
  /// Row k = `row`, row_bytes of private memory; k is one more than the last.
  void publish(Iteration k, const std::byte* row) noexcept;
  /// Row k will follow soon: fetches what its publication writes.
  void expect(Iteration k) const noexcept;

 private:
  Counters* counters_;
  std::byte* slots_begin_;
  std::size_t row_bytes_;
  std::uint64_t slots_;
};

/// Reads rows by iteration; never a torn one, never waits.
///
/// Writer:   HistoryWriter.
/// Readers:  const calls from any thread; a read-only mapping is enough.
/// Realtime: single rows yes, bulk as long as it is.
class HistoryReader {
 public:
  struct Range {
    Iteration first;    // of the rows returned
    std::size_t count;  // 0: none
  };

  explicit HistoryReader(const SegmentView& view) noexcept;

  std::size_t row_bytes() const noexcept { return row_bytes_; }
  /// Rows promised.
  std::uint64_t rows() const noexcept { return slots_ - 1; }
  /// The newest row, -1 before the first.
  Iteration published() const noexcept;
  /// The oldest row still promised; 0 before the first.
  Iteration oldest() const noexcept;
  /// Copies row k; false if not published yet or overwritten.
  bool read(Iteration k, std::byte* to) const noexcept;
  /// Copies the newest row; its iteration, or -1 if there is none (or is_damaged()).
  Iteration latest(std::byte* to) const noexcept;
  /// No backend leaves counters like these: no row can be told from one being overwritten.
  bool is_damaged() const noexcept;
  /// Copies rows first .. first + count - 1 as far as they are there, packed at the start of `to`.
  Range read_range(Iteration first, std::size_t count, std::byte* to) const noexcept;

 private:
  const std::byte* slot(Iteration k) const noexcept;
  /// The row being written, or the newest.
  Iteration begun() const noexcept;
  /// Of what was copied before this call, rows from here on are whole.
  Iteration first_true() const noexcept;

  const Counters* counters_;
  const std::byte* slots_begin_;
  std::size_t row_bytes_;
  std::uint64_t slots_;
};

}  // namespace o80
