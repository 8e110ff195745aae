#pragma once

#include <cstdint>

namespace o80::test {

/// What the layers of an iteration have done.
struct CountedWork {
  std::uint32_t blocks = 0;  // different ones, that were looked at
  std::uint32_t visits = 0;  // looks at blocks
  std::uint32_t batches = 0;
  std::uint32_t statuses = 0;
  std::uint32_t drops = 0;          // of an actuator's queue
  std::uint32_t speed_changes = 0;  // planned
  std::uint32_t trapezoids = 0;     // tried for them
  std::uint32_t smooth_motions = 0;
};

/// Since this was last asked.
CountedWork work_since_last_asked() noexcept;

}  // namespace o80::test
