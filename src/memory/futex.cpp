#include "o80/memory/futex.hpp"

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

}  // namespace o80
