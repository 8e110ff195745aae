#pragma once

#include <cstdint>

#include "o80/runtime/backend.hpp"

namespace o80 {

/// Keeps a loop at its period by the monotonic clock.
///
/// An iteration that ends too late is counted; the periods it missed are left out, so that no
/// burst of late iterations follows.
///
/// Realtime: one system call a period.
class Pacer {
 public:
  explicit Pacer(std::int64_t period) : period_(period) {}

  /// The first period begins now.
  void begin() noexcept;
  /// When the period under way ends [ns].
  std::int64_t due() const noexcept { return due_; }
  /// Sleeps to the end of the period, unless it is over.
  void sleep() noexcept;
  /// The period is over: measures how late, and sets the next one.
  const Timing& next() noexcept;

 private:
  std::int64_t period_;
  std::int64_t due_ = 0;
  bool overrun_ = false;
  Timing timing_;
};

}  // namespace o80
