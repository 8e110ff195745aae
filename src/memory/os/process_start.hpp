#pragma once

#include <cstdint>

namespace o80 {

struct ProcessState {
  char letter = 0;          // as in `ps`: 'T' or 't' for one that is stopped
  std::uint64_t start = 0;  // in clock ticks since boot; 0: there is no such process
};

/// Process ids are reused: id and start time together identify a process.
ProcessState process_state(int pid) noexcept;
inline std::uint64_t process_start(int pid) noexcept { return process_state(pid).start; }

}  // namespace o80
