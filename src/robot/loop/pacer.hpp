#pragma once

#include <cstdint>

#include "o80/runtime/backend.hpp"

namespace o80 {

/// Computes due times, lateness, overruns and skipped periods from the times that the caller
/// passes.
///
/// An iteration whose work or wake-up is late counts as one overrun. Missed periods are skipped, so
/// that late iterations are not made up for in a rush.
///
/// Realtime: arithmetic only.
class Pacer {
 public:
  explicit Pacer(std::int64_t period) : period_(period) {}

  /// Begins the first period.
  void begin(std::int64_t now) noexcept { due_ = now + period_; }
  /// End of the current period [ns].
  std::int64_t due() const noexcept { return due_; }
  /// The work of the period is done. False, and an overrun, if the period had already ended.
  bool in_time(std::int64_t now) noexcept;
  /// Woken by the clock: measures the lateness and begins the next period. A lateness of a whole
  /// period or more is an overrun.
  const Timing& next(std::int64_t now) noexcept;
  /// Woken by the robot's tick: measures the lateness and begins the next period at `now`.
  const Timing& tick(std::int64_t now) noexcept;
  /// The last tick brought no reading: counts an overrun, unless this period has one already.
  const Timing& missed() noexcept;
  /// True if ticks are more than kMaxPeriodsAhead periods ahead of the clock. Speed limits, which
  /// are applied per iteration, then no longer hold.
  bool runs_ahead() const noexcept { return excess() > 0; }
  /// Time by which ticks are farther ahead than that [ns].
  std::int64_t excess() const noexcept { return ahead_ - kMaxPeriodsAhead * period_; }
  /// The caller has slept after a tick that was too early.
  void slept(std::int64_t time) noexcept {
    ahead_ -= time;
    due_ += time;
    fast_.time += time;
  }
  /// The ticks since the ticks were last in time with the clock.
  struct FastTicks {
    std::int64_t ticks = 0;
    std::int64_t time = 0;  // from the first to the last of them [ns]
  };
  const FastTicks& fast_ticks() const noexcept { return fast_; }

 private:
  /// After a gap, late ticks may arrive together; more than this many are too fast.
  static constexpr std::int64_t kMaxPeriodsAhead = 10;
  /// The robot's clock may always be faster than this one by 1 part in 50.
  static constexpr std::int64_t kClockTolerance = 50;

  /// At most one overrun a period.
  void count_overrun() noexcept;

  std::int64_t period_;
  std::int64_t due_ = 0;
  bool overrun_ = false;    // one was counted in this period
  std::int64_t ahead_ = 0;  // time by which the ticks are ahead of the clock [ns]
  FastTicks fast_;
  Timing timing_;
};

/// Sleeps until `due` on the monotonic clock [ns]; false if a signal interrupted it.
///
/// Realtime: one system call.
bool sleep_until(std::int64_t due) noexcept;

}  // namespace o80
