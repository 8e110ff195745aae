#pragma once

#include <cstdint>

namespace o80 {

/// Version of the rules that make desired states of commands. It grows when the same commands give
/// other desired states; recordings say under which rules they were made.
///
/// 1: a profile that the limiter follows.
/// 2: each command is planned to rest at its target within the limits; set-points.
inline constexpr std::int64_t kMotionRules = 2;

}  // namespace o80
