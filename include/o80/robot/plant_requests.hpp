#pragma once

#include <cstdint>

#include "o80/describe/describe.hpp"

namespace o80 {

/// What every simulator and simulated plant serves.
struct Reset {
  std::uint64_t seed = 0;
};
struct Snapshot {
  std::uint32_t slot = 0;
};
struct Restore {
  std::uint32_t slot = 0;
};
O80_DESCRIBE(Reset, (seed, "of whatever the start draws by chance"));
O80_DESCRIBE(Snapshot, (slot, "where the whole state is kept"));
O80_DESCRIBE(Restore, (slot, "of the state to go back to, bit for bit"));

}  // namespace o80
