#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace o80 {

/// What a loop's thread asks of the machine.
struct RealTimeOptions {
  enum class Policy : std::uint8_t { other, fifo, round_robin };
  Policy policy = Policy::other;
  int priority = 0;             // 1 to 99, for fifo and round_robin
  std::vector<int> processors;  // that the loop may use; empty: all
  bool lock_memory = false;
  std::size_t stack = 256U << 10;  // touched beforehand [bytes]
};

/// Sets up the calling thread. What the machine refuses is returned, a line each, with the command
/// that would allow it; the rest holds.
std::vector<std::string> set_up_real_time(const RealTimeOptions& options);

}  // namespace o80
