#pragma once

#include <cstdint>

namespace o80 {

/// Version of the rules that make desired states of commands. It grows when the same commands give
/// other desired states; recordings say under which rules they were made.
///
/// 1: until now.
inline constexpr std::int64_t kMotionRules = 1;

}  // namespace o80
