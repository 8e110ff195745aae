#pragma once

#include <cstdint>

#include "control/queue/controller.hpp"

namespace o80 {

/// A burst that the thread of the loop begins itself, with the targets of its iterations, instead
/// of a frontend that sends a batch.
struct DirectBurst {
  std::int64_t iterations = 1;
  std::int64_t delay = 0;  // iterations before the first target
  DirectTargets targets;   // all within the burst; `first` is set when it begins
};

}  // namespace o80
