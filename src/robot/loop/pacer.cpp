#include "robot/loop/pacer.hpp"

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <cerrno>

namespace o80 {

bool Pacer::in_time(std::int64_t now) noexcept {
  overrun_ = false;
  if (now > due_) count_overrun();
  return !overrun_;
}

const Timing& Pacer::next(std::int64_t now) noexcept {
  timing_.missed = false;
  timing_.lateness = now - due_;
  due_ += period_;
  if (due_ <= now) {
    const std::int64_t missed = (now - due_) / period_ + 1;
    timing_.skipped += static_cast<std::uint32_t>(missed);
    due_ += missed * period_;
    count_overrun();
  }
  timing_.next_due = due_;
  return timing_;
}

const Timing& Pacer::tick(std::int64_t now) noexcept {
  timing_.missed = false;
  timing_.lateness = now - due_;
  // the robot has a clock of its own: a tick counts for the nearest period
  if (timing_.lateness > 0) {
    const auto missed = static_cast<std::uint32_t>((timing_.lateness + period_ / 2) / period_);
    timing_.skipped += missed;
    if (missed > 0) count_overrun();
  }
  // late ticks compensate early ones
  ahead_ -= timing_.lateness + period_ / kClockTolerance;
  if (ahead_ > 0) {
    ++fast_.ticks;
    fast_.time += period_ + timing_.lateness;
  } else {
    ahead_ = 0;
    fast_ = {};
  }
  due_ = now + period_;
  return timing_;
}

const Timing& Pacer::missed() noexcept {
  count_overrun();
  timing_.missed = true;
  return timing_;
}

void Pacer::count_overrun() noexcept {
  if (!overrun_) ++timing_.overruns;
  overrun_ = true;
}

bool sleep_until(std::int64_t due) noexcept {
  timespec until;
  until.tv_sec = due / 1'000'000'000;
  until.tv_nsec = due % 1'000'000'000;
  const int refused = clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
  if (refused == 0) return true;
  if (refused != EINTR) {  // by a sandbox: another call, and if that is refused too, the loop polls
    const std::int64_t left = std::max<std::int64_t>(due - monotonic_now(), 0);
    const timespec rest{.tv_sec = left / 1'000'000'000, .tv_nsec = left % 1'000'000'000};
    ppoll(nullptr, 0, &rest, nullptr);
  }
  return monotonic_now() >= due;
}

}  // namespace o80
