#pragma once

#include <atomic>
#include <cstdint>
#include <span>

namespace o80 {

inline constexpr int kEverybody = 0x7fffffff;

/// Sleeps while `word` is `expected`, at most `at_most` [ns]; true if woken by futex_wake.
bool futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                std::int64_t at_most) noexcept;

/// A word, and what it holds as long as there is nothing new.
struct FutexWord {
  const std::atomic<std::uint32_t>* word;
  std::uint32_t expected;
};

inline constexpr std::size_t kMaxFutexWords = 128;  // of one wait, says the kernel

/// Sleeps while each of up to kMaxFutexWords words is as expected, at most `at_most` [ns]; false
/// at once if the kernel cannot do that (before Linux 5.16, or forbidden in a container).
bool futex_wait_any(std::span<const FutexWord> words, std::int64_t at_most) noexcept;

/// Wakes up to `count` sleeping threads of any process; a read-only mapping is enough.
void futex_wake(const std::atomic<std::uint32_t>& word, int count) noexcept;

/// Wakes the sleepers of two words in one call: up to `count` of `first`, all of `second`. `second`
/// must be writable, and only the caller may write it.
void futex_wake_both(const std::atomic<std::uint32_t>& first, int count,
                     std::atomic<std::uint32_t>& second) noexcept;

}  // namespace o80
