#pragma once

#include <cstdint>
#include <string_view>

#include "o80/describe/describe.hpp"

namespace o80 {

/// Requests of every simulator, served also during a halt, because nothing real moves. They do
/// not end the halt.
struct Reset {
  static constexpr std::string_view kHelp = "return to the start state";
  static constexpr bool kWhileHalted = true;
  std::uint64_t seed = 0;
};
struct Snapshot {
  static constexpr std::string_view kHelp = "save the whole state";
  static constexpr bool kWhileHalted = true;
  std::uint32_t slot = 0;
};
struct Restore {
  static constexpr std::string_view kHelp = "return to a saved state";
  static constexpr bool kWhileHalted = true;
  std::uint32_t slot = 0;
};
O80_DESCRIBE(Reset, (seed, "seed of a random start state"));
O80_DESCRIBE(Snapshot, (slot, "slot in which the state is saved"));
O80_DESCRIBE(Restore, (slot, "slot of the state to restore, bit for bit"));

}  // namespace o80
