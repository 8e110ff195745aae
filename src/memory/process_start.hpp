#pragma once

#include <cstdint>

namespace o80 {

/// When a process began, in ticks since the machine did; 0 if there is no such process. With the
/// process id it names a process for good: ids are used again.
std::uint64_t process_start(int pid) noexcept;

}  // namespace o80
