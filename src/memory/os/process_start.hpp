#pragma once

#include <cstdint>

namespace o80 {

/// Start time of a process, in clock ticks since boot; 0 if there is no such process. Process ids
/// are reused: id and start time together identify a process.
std::uint64_t process_start(int pid) noexcept;

}  // namespace o80
