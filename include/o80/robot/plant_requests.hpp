#pragma once

#include <cstdint>
#include <string_view>

#include "o80/describe/describe.hpp"

namespace o80 {

/// What every simulator and simulated plant serves, also while it is halted: nothing real moves,
/// and the halt stands until it is resumed.
struct Reset {
  static constexpr std::string_view kHelp = "back to the start";
  static constexpr bool kWhileHalted = true;
  std::uint64_t seed = 0;
};
struct Snapshot {
  static constexpr std::string_view kHelp = "keep the whole state";
  static constexpr bool kWhileHalted = true;
  std::uint32_t slot = 0;
};
struct Restore {
  static constexpr std::string_view kHelp = "back to a state that was kept";
  static constexpr bool kWhileHalted = true;
  std::uint32_t slot = 0;
};
O80_DESCRIBE(Reset, (seed, "of whatever the start draws by chance"));
O80_DESCRIBE(Snapshot, (slot, "where the whole state is kept"));
O80_DESCRIBE(Restore, (slot, "of the state to go back to, bit for bit"));

}  // namespace o80
