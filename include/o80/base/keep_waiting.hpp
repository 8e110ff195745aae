#pragma once

#include <functional>

namespace o80 {

/// Called about every 50 ms during a wait; return false to end the wait with Cancelled. An empty
/// function never ends a wait.
using KeepWaiting = std::function<bool()>;

}  // namespace o80
