#pragma once

namespace o80 {

/// Functions of a state type; null: the default is used.
struct TypeHooks {
  /// Interpolates: writes the state at the fraction `share` (0 to 1) between `from` and `to` to
  /// `out`.
  void (*blend)(void* out, const void* from, const void* to, double share) = nullptr;
};

}  // namespace o80
