#pragma once

#include <algorithm>
#include <cstdint>

#include "control/batch/record.hpp"
#include "control/receiving/batch_plan.hpp"

namespace o80 {

/// Budget of an iteration for batches: 1 for each block copied or checked, more for each step of
/// taking a batch. The last batch taken may exceed it.
inline constexpr std::uint32_t kWorkPerIteration = 1024;

/// The rest of the budget of one iteration.
///
/// Realtime: yes.
struct WorkShare {
  std::uint32_t work = kWorkPerIteration;
  std::uint32_t requests = kMaxRequests;

  /// One batch may exceed the work; none may exceed the number of requests.
  bool affords(const Effort& effort) const noexcept {
    return work > 0 && effort.requests <= requests;
  }
  void spend(const Effort& effort) noexcept {
    work -= std::min(work, effort.work);
    requests -= effort.requests;
  }
};

}  // namespace o80
