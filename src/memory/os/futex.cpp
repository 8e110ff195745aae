#include "memory/os/futex.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "o80/base/time.hpp"

namespace o80 {

bool futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                std::int64_t at_most) noexcept {
  if (at_most <= 0) return false;
  const timespec timeout{.tv_sec = static_cast<time_t>(at_most / 1'000'000'000),
                         .tv_nsec = static_cast<long>(at_most % 1'000'000'000)};
  // not FUTEX_PRIVATE_FLAG: the processes share the file, not the address
  return syscall(SYS_futex, &word, FUTEX_WAIT, expected, &timeout, nullptr, 0) == 0;
}

namespace {

// as linux/futex.h has them since 5.16; Debian 11 compiles against older headers
struct Waiter {
  std::uint64_t value;
  std::uint64_t address;
  std::uint32_t flags;
  std::uint32_t reserved;
};
struct Moment {  // __kernel_timespec
  std::int64_t seconds;
  std::int64_t nanoseconds;
};
constexpr long kFutexWaitv = 449;           // the same on every architecture but alpha
constexpr std::uint32_t kFourBytes = 0x02;  // and shared with other processes

}  // namespace

bool futex_wait_any(std::span<const FutexWord> words, std::int64_t at_most) noexcept {
  if (at_most <= 0) return true;
  std::array<Waiter, kMaxFutexWords> waiters{};
  const std::size_t count = std::min(words.size(), waiters.size());
  for (std::size_t i = 0; i < count; ++i) {
    waiters[i] = {.value = words[i].expected,
                  .address = reinterpret_cast<std::uintptr_t>(words[i].word),
                  .flags = kFourBytes,
                  .reserved = 0};
  }
  const std::int64_t end = monotonic_now() + at_most;
  const Moment until{.seconds = end / 1'000'000'000, .nanoseconds = end % 1'000'000'000};
  const long woken = syscall(kFutexWaitv, waiters.data(), count, 0, &until, CLOCK_MONOTONIC);
  return woken >= 0 || errno == EAGAIN || errno == ETIMEDOUT || errno == EINTR;
}

void futex_wake(const std::atomic<std::uint32_t>& word, int count) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAKE, count, nullptr, nullptr, 0);
}

void futex_wake_both(const std::atomic<std::uint32_t>& first, int count,
                     std::atomic<std::uint32_t>& second) noexcept {
  // FUTEX_WAKE_OP adds 0 to the second word and compares its old value with a value that it does
  // not have, so the second wake always happens
  const std::uint32_t other = second.load(std::memory_order_relaxed) == 0 ? 1 : 0;
  syscall(SYS_futex, &first, FUTEX_WAKE_OP, count, static_cast<long>(kEverybody), &second,
          FUTEX_OP(FUTEX_OP_ADD, 0, FUTEX_OP_CMP_NE, other));
}

}  // namespace o80
