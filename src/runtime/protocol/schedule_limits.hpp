#pragma once

#include <cstdint>

namespace o80 {

// most batches of one lane that may wait for later iterations; `pulse` refuses more
inline constexpr std::uint32_t kMaxScheduled = 256;
inline constexpr std::uint32_t kMaxScheduledAt = 16;  // for the same iteration

}  // namespace o80
