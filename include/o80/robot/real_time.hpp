#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace o80 {

/// Real-time settings of the loop's thread.
struct RealTimeOptions {
  /// automatic: fifo if the machine grants it, else other; after 200 ms without sleep the thread
  /// becomes an ordinary one, and says so on the standard error.
  enum class Policy : std::uint8_t { other, fifo, round_robin, automatic };
  Policy policy = Policy::other;
  int priority = 0;             // 1 to 99, unless the policy is other
  std::vector<int> processors;  // allowed for the loop; empty: all
  bool lock_memory = false;
  // the thread sleeps in each period: RealtimeKit may grant a priority that limits refuse
  bool sleeps = false;
  std::size_t stack = 256U << 10;  // stack touched before the loop runs [bytes]
};

/// Sets up the calling thread. Returns a line for each setting that the machine refused, with the
/// command that would allow it; the other settings apply.
std::vector<std::string> set_up_real_time(const RealTimeOptions& options);

}  // namespace o80
