#pragma once

#include <functional>

namespace o80 {

/// Asked now and then in every wait; false ends the wait with Cancelled. Empty: never asked.
using KeepWaiting = std::function<bool()>;

}  // namespace o80
