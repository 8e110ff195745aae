#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "control/motion/visit_block.hpp"

namespace o80::test {

/// What the layers of an iteration have done.
struct CountedWork {
  std::uint32_t blocks = 0;  // different ones, that were looked at
  std::uint32_t visits = 0;  // looks at blocks
  std::array<std::uint32_t, 6> counts{};

  std::uint32_t operator[](Work what) const { return counts.at(static_cast<std::size_t>(what)); }
};

/// Since this was last asked.
CountedWork work_since_last_asked() noexcept;

}  // namespace o80::test
