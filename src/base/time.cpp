#include "o80/base/time.hpp"

#include <time.h>

#include <algorithm>
#include <limits>

namespace o80 {

namespace {
constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

std::int64_t read_clock(clockid_t clock) noexcept {
  timespec now;
  clock_gettime(clock, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}
}  // namespace

std::int64_t monotonic_now() noexcept { return read_clock(CLOCK_MONOTONIC); }
std::int64_t boot_now() noexcept { return read_clock(CLOCK_BOOTTIME); }
std::int64_t wall_clock_now() noexcept { return read_clock(CLOCK_REALTIME); }
std::int64_t monotonic_roughly_now() noexcept { return read_clock(CLOCK_MONOTONIC_COARSE); }

Deadline::Deadline(Timeout timeout) noexcept : end_(kNever) {
  if (!timeout) return;
  const std::int64_t now = monotonic_now();
  const std::int64_t wait = std::max<std::int64_t>(timeout->count(), 0);
  end_ = wait > kNever - now ? kNever : now + wait;
}

bool Deadline::over() const noexcept { return end_ != kNever && monotonic_now() >= end_; }

std::int64_t Deadline::left(std::int64_t cap) const noexcept {
  if (end_ == kNever) return cap;
  return std::clamp<std::int64_t>(end_ - monotonic_now(), 0, cap);
}

}  // namespace o80
