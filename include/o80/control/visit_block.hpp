#pragma once

#include <cstdint>

/// A look at a block of the pool, counted by tests that prove how few an iteration needs.
///
/// Compiles to nothing unless O80_COUNT_BLOCKS is defined; then the test defines the function.
#ifdef O80_COUNT_BLOCKS
namespace o80 {
void visit_block(std::uint32_t block) noexcept;
}
#define O80_VISIT_BLOCK(block) ::o80::visit_block(block)
#else
#define O80_VISIT_BLOCK(block) static_cast<void>(0)
#endif
