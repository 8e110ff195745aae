#pragma once

namespace o80 {

/// A state type's own way to interpolate; null where the default serves.
struct TypeHooks {
  /// `out` becomes the state at `share` (0 to 1) of the way from `from` to `to`.
  void (*blend)(void* out, const void* from, const void* to, double share) = nullptr;
};

}  // namespace o80
