#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "o80/describe/rows.hpp"

namespace o80 {

/// A number of a row: its offset and its type.
struct RowNumber {
  std::uint32_t at = 0;  // [bytes] from the begin of the row
  Kind kind = Kind::float64;
};

/// One number of an observation: clip((number - offset) * scale), computed as double.
struct GatheredNumber {
  RowNumber from;
  double offset = 0;
  double scale = 1;
  double low = 0;
  double high = 0;  // clipped if low < high
};

/// One event flag: whether a number compares so with a value.
struct EventFlag {
  enum class Compare : std::uint8_t { equal, unequal, less, less_equal, greater, greater_equal };
  RowNumber from;
  Compare compare = Compare::unequal;
  double value = 0;
};

/// Reads an observation and event flags from a row.
///
/// Realtime: yes.
struct RowGather {
  std::vector<GatheredNumber> numbers;
  std::vector<EventFlag> flags;

  /// `observation` has a place for each number, `raised` for each flag.
  void read(const std::byte* row, std::span<float> observation,
            std::span<std::uint8_t> raised) const noexcept;
};

}  // namespace o80
