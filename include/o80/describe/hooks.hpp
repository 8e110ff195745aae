#pragma once

namespace o80 {

/// A state type's own way to interpolate and to rest; null where the default serves.
struct TypeHooks {
  /// `out` becomes the state at `share` (0 to 1) of the way from `from` to `to`.
  void (*blend)(void* out, const void* from, const void* to, double share) = nullptr;
  /// Turns the last desired state into the one to hold when no command is left.
  void (*hold)(void* state) = nullptr;
};

}  // namespace o80
