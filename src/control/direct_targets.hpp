#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "o80/base/time.hpp"
#include "o80/control/command.hpp"

namespace o80 {

/// Targets of consecutive iterations that reach the desired states without a batch: what an inline
/// group sends in a burst. They act as one trajectory with a target in each iteration.
struct DirectTargets {
  std::span<const std::uint32_t> actuators;  // each once
  std::uint32_t steps = 0;                   // targets of each actuator
  const std::byte* states = nullptr;  // those of the first actuator, then those of the second, ...
  Mode mode = Mode::queue;
  Iteration first = 0;  // the iteration of the first target

  bool acts(Iteration iteration) const noexcept {
    return iteration >= first && iteration - first < static_cast<Iteration>(steps);
  }
};

}  // namespace o80
