#pragma once

#include <cstdint>

namespace o80 {

/// 64 random bits, never 0: from the kernel, or from clock and process where that is refused.
std::uint64_t random_bits() noexcept;

}  // namespace o80
