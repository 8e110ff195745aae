#include "memory/futex.hpp"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

namespace o80 {

bool futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                std::int64_t at_most) noexcept {
  if (at_most <= 0) return false;
  const timespec timeout{.tv_sec = static_cast<time_t>(at_most / 1'000'000'000),
                         .tv_nsec = static_cast<long>(at_most % 1'000'000'000)};
  // not the private kind: sleepers and wakers share the file, not the address
  return syscall(SYS_futex, &word, FUTEX_WAIT, expected, &timeout, nullptr, 0) == 0;
}

void futex_wake(const std::atomic<std::uint32_t>& word, int count) noexcept {
  syscall(SYS_futex, &word, FUTEX_WAKE, count, nullptr, nullptr, 0);
}

void futex_wake_both(const std::atomic<std::uint32_t>& first, int count,
                     std::atomic<std::uint32_t>& second) noexcept {
  // the kernel adds 0 to the second word, and wakes its sleepers if the word was not what it is not
  const std::uint32_t other = second.load(std::memory_order_relaxed) == 0 ? 1 : 0;
  syscall(SYS_futex, &first, FUTEX_WAKE_OP, count, static_cast<long>(kEverybody), &second,
          FUTEX_OP(FUTEX_OP_ADD, 0, FUTEX_OP_CMP_NE, other));
}

}  // namespace o80
