#include "o80/robot/pacer.hpp"

#include <time.h>

#include <cerrno>

#include "o80/base/time.hpp"

namespace o80 {

void Pacer::begin() noexcept { due_ = monotonic_now() + period_; }

void Pacer::sleep() noexcept {
  overrun_ = monotonic_now() > due_;
  if (overrun_) return;
  timespec until;
  until.tv_sec = due_ / 1'000'000'000;
  until.tv_nsec = due_ % 1'000'000'000;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

const Timing& Pacer::next() noexcept {
  const std::int64_t now = monotonic_now();
  timing_.lateness = now - due_;
  if (overrun_) ++timing_.overruns;
  overrun_ = false;
  due_ += period_;
  if (due_ <= now) {
    const std::int64_t missed = (now - due_) / period_ + 1;
    timing_.skipped += static_cast<std::uint32_t>(missed);
    due_ += missed * period_;
  }
  return timing_;
}

}  // namespace o80
