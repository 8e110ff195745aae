#pragma once

#include <atomic>
#include <cstdint>

namespace o80 {

inline constexpr int kEverybody = 0x7fffffff;

/// Sleeps while `word` is `expected`, at most `at_most` [ns]; true if woken by futex_wake.
bool futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                std::int64_t at_most) noexcept;

/// Wakes up to `count` sleepers of any process; works through a read-only mapping.
void futex_wake(const std::atomic<std::uint32_t>& word, int count) noexcept;

}  // namespace o80
