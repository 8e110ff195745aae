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
  /// The tick of the period that has just ended brought no reading: an overrun, unless the period
  /// counted as one already.
  const Timing& missed() noexcept;
  /// Ticks have come so much faster than the period says that no limit of a speed holds any more.
  bool runs_ahead() const noexcept { return ahead_ > kMostPeriodsAhead * period_; }
  /// The ticks that came too fast, since they last came in time.
  struct FastTicks {
    std::int64_t ticks = 0;
    std::int64_t time = 0;  // in which they came [ns]
  };
  const FastTicks& fast_ticks() const noexcept { return fast_; }

 private:
  /// Ticks that were late may be caught up at once: so many, however long they were missing.
  static constexpr std::int64_t kMostPeriodsAhead = 10;
  /// The robot's clock may be faster than this one by one part in so many, for ever.
  static constexpr std::int64_t kClockTolerance = 50;

  /// Once a period.
  void count_overrun() noexcept;

  std::int64_t period_;
  std::int64_t due_ = 0;
  bool overrun_ = false;    // counted in this period
  std::int64_t ahead_ = 0;  // of the clock, by the ticks [ns]
  FastTicks fast_;
  Timing timing_;
};

/// Sleeps until a moment of the monotonic clock [ns]; false if a signal came first.
///
/// Realtime: one system call.
bool sleep_until(std::int64_t due) noexcept;

}  // namespace o80
