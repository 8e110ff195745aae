#pragma once

#include <cmath>
#include <cstdint>

namespace o80 {

// std::floor and std::ceil without a call: the oldest processors of x86-64 have no instruction.

/// The largest whole number that is at most `value`.
inline double whole_below(double value) noexcept {
  constexpr double kAllWhole = 0x1p52;  // above, every double is whole
  if (!(std::abs(value) < kAllWhole)) return value;
  const auto cut = static_cast<double>(static_cast<std::int64_t>(value));
  return cut > value ? cut - 1.0 : cut;
}

/// The smallest whole number that is at least `value`.
inline double whole_above(double value) noexcept { return -whole_below(-value); }

}  // namespace o80
