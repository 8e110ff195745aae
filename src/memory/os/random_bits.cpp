#include "memory/os/random_bits.hpp"

#include <sys/random.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

#include "o80/base/time.hpp"

namespace o80 {

std::uint64_t random_bits() noexcept {
  std::uint64_t bits = 0;
  while (bits == 0) {
    if (getrandom(&bits, sizeof bits, 0) == sizeof bits) continue;
    if (errno == EINTR) continue;
    // refused by a sandbox: they need to differ between processes and calls, not to be secret
    static std::atomic<std::uint64_t> calls{0};
    bits = static_cast<std::uint64_t>(monotonic_now()) ^ static_cast<std::uint64_t>(getpid()) << 40;
    bits = (bits + calls.fetch_add(1)) * 0x9e3779b97f4a7c15U;
    bits ^= bits >> 32;
  }
  return bits;
}

}  // namespace o80
