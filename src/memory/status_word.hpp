#pragma once

#include <cstdint>

#include "o80/base/time.hpp"

namespace o80 {

/// A status as it stands in the segment; what the numbers mean is not known here (0 is none).
struct StatusWord {
  std::uint8_t status = 0;  // 4 bits, never 0 when written
  std::uint8_t reason = 0;  // 4 bits
  std::uint8_t detail = 0;
  Iteration iteration = 0;  // 48 bits

  constexpr std::uint64_t packed() const noexcept {
    return (static_cast<std::uint64_t>(iteration) & 0xffff'ffff'ffffULL) |
           static_cast<std::uint64_t>(status & 15) << 48 |
           static_cast<std::uint64_t>(reason & 15) << 52 | static_cast<std::uint64_t>(detail) << 56;
  }
  static constexpr StatusWord unpack(std::uint64_t word) noexcept {
    return {.status = static_cast<std::uint8_t>(word >> 48 & 15),
            .reason = static_cast<std::uint8_t>(word >> 52 & 15),
            .detail = static_cast<std::uint8_t>(word >> 56),
            .iteration = static_cast<std::int64_t>(word << 16) >> 16};
  }
  /// What stands in a place before the first status of an id: the id, and no status. Whoever asks
  /// for the one before knows then that it is forgotten, though the backend die here.
  static constexpr std::uint64_t announcing(std::uint64_t id) noexcept {
    return id & 0xffff'ffff'ffffULL;
  }
  friend bool operator==(const StatusWord&, const StatusWord&) = default;
};

}  // namespace o80
