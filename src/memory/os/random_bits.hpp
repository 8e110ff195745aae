#pragma once

#include <cstdint>

namespace o80 {

/// 64 random bits from the kernel, never 0.
std::uint64_t random_bits() noexcept;

}  // namespace o80
