#pragma once

#include <algorithm>
#include <cstdint>

namespace o80 {

/// Converts durations to whole numbers of iterations, so that their sum does not drift.
///
/// The rounding of each duration is carried to the next duration of the same queue. So is the
/// excess of durations that are rounded up to one iteration.
class DurationCarry {
 public:
  explicit DurationCarry(std::int64_t period = 1) noexcept : period_(period > 0 ? period : 1) {}

  /// Number of iterations of the next duration [ns], at least 1.
  std::int64_t iterations(std::int64_t duration) noexcept {
    const std::int64_t rounded = std::max<std::int64_t>(1, whole(duration));
    carry_ += duration - rounded * period_;
    return rounded;
  }
  /// True if the duration ends before the next iteration: it joins the carry, without an iteration.
  bool pass(std::int64_t duration) noexcept {
    if (whole(duration) >= 1) return false;
    carry_ += duration;
    return true;
  }
  void reset() noexcept { carry_ = 0; }
  /// The carry [ns].
  std::int64_t carried() const noexcept { return carry_; }
  /// Replaces the carry, by that of the other queues of a group command.
  void carry(std::int64_t nanoseconds) noexcept { carry_ = nanoseconds; }

 private:
  /// Iterations until the exact end of a duration, rounded; 0 or less if that has passed.
  std::int64_t whole(std::int64_t duration) const noexcept {
    const std::int64_t shifted = carry_ + duration + period_ / 2;
    return shifted / period_ - (shifted % period_ < 0 ? 1 : 0);
  }

  std::int64_t period_;     // [ns]
  std::int64_t carry_ = 0;  // exact end of the last command minus its rounded end [ns]
};

}  // namespace o80
