#pragma once

#include <cstdint>

#include "o80/runtime/backend.hpp"

namespace o80 {

/// Keeps the account of a loop's periods; the caller tells it the time.
///
/// An iteration whose work or wake-up comes too late is counted once; the periods it missed are
/// left out, so that no burst of late iterations follows.
///
/// Realtime: arithmetic only.
class Pacer {
 public:
  explicit Pacer(std::int64_t period) : period_(period) {}

  /// The first period begins now.
  void begin(std::int64_t now) noexcept { due_ = now + period_; }
  /// When the period under way ends [ns].
  std::int64_t due() const noexcept { return due_; }
  /// The work of the period is done; false, and counted, if the period was over before.
  bool in_time(std::int64_t now) noexcept;
  /// The period is over by the clock: measures how late, and sets the next one. Woken a whole
  /// period late, or more, is an overrun too.
  const Timing& next(std::int64_t now) noexcept;
  /// The period is over because the robot ticked: the next one is measured from here.
  const Timing& tick(std::int64_t now) noexcept;

 private:
  std::int64_t period_;
  std::int64_t due_ = 0;
  bool overrun_ = false;  // counted in this period
  Timing timing_;
};

/// Sleeps until a moment of the monotonic clock [ns]; false if a signal came first.
///
/// Realtime: one system call.
bool sleep_until(std::int64_t due) noexcept;

}  // namespace o80
