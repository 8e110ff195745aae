#pragma once

#include <cstdint>

#include "o80/base/time.hpp"

namespace o80 {

/// A status as stored in a StatusSlot. This layer does not know the meaning of the numbers (0: no
/// status).
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
  /// The word of a slot between its new id and the first status of that id. If the backend crashes
  /// in between, the former id of the slot reads as forgotten (src/memory/README.md#lanes). It is
  /// the 48 bits that an id has.
  static constexpr std::uint64_t announcing(std::uint64_t id) noexcept {
    return id & 0xffff'ffff'ffffULL;
  }
  friend bool operator==(const StatusWord&, const StatusWord&) = default;
};

}  // namespace o80
