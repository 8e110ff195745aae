#include "memory/os/random_bits.hpp"

#include <sys/random.h>

namespace o80 {

std::uint64_t random_bits() noexcept {
  std::uint64_t bits = 0;
  while (bits == 0)
    if (getrandom(&bits, sizeof bits, 0) != sizeof bits) bits = 0;
  return bits;
}

}  // namespace o80
