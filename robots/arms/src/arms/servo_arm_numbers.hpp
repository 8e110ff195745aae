#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <thread>

#include "arms/servo_chain.hpp"

// Numbers of the driver of an arm, and what its two sources share.

namespace o80::arms {

inline constexpr double kMostSpeed = 2.5;  // [rad/s]
inline constexpr double kGentleStrength = 0.3;
inline constexpr int kBacklash = 40;  // [steps]
inline constexpr int kEdge = 10;      // outside the range without moving when clamped [steps]

inline bool has(ServoChain::Mask mask, std::size_t servo) { return (mask >> servo & 1) != 0; }
inline ServoChain::Mask bit(std::size_t servo) { return ServoChain::Mask{1} << servo; }
/// Returns at this moment of the monotonic clock [ns].
inline void sleep_until(std::int64_t moment) {
  std::this_thread::sleep_for(std::chrono::nanoseconds(moment - now()));
}

}  // namespace o80::arms
