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

/// The same for two words in one call: up to `count` sleepers of `first`, and all of `second`,
/// which must be writable and is written by the caller only.
void futex_wake_both(const std::atomic<std::uint32_t>& first, int count,
                     std::atomic<std::uint32_t>& second) noexcept;

}  // namespace o80
