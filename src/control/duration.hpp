#pragma once

#include <algorithm>
#include <cstdint>

namespace o80 {

/// Turns durations into whole numbers of iterations such that their sum never drifts.
///
/// What rounding added or took away is carried to the next duration of an unbroken queue; so is the
/// debt of durations too short for the iteration that each takes at least.
class DurationCarry {
 public:
  explicit DurationCarry(std::int64_t period = 1) noexcept : period_(period > 0 ? period : 1) {}

  /// Iterations of the next duration [ns], at least 1.
  std::int64_t iterations(std::int64_t duration) noexcept {
    const std::int64_t rounded = whole(duration);
    carry_ += duration - std::max<std::int64_t>(1, rounded) * period_;
    return std::max<std::int64_t>(1, rounded);
  }
  /// A duration that is over before the next iteration would be; then it is counted, and takes
  /// none.
  bool pass(std::int64_t duration) noexcept {
    if (whole(duration) >= 1) return false;
    carry_ += duration;
    return true;
  }
  void reset() noexcept { carry_ = 0; }
  /// What is carried [ns], and the carry of another queue in its place: theirs go on together.
  std::int64_t carried() const noexcept { return carry_; }
  void carry(std::int64_t nanoseconds) noexcept { carry_ = nanoseconds; }

 private:
  /// Iterations until the exact end of a duration, rounded; not above 0 if that has passed.
  std::int64_t whole(std::int64_t duration) const noexcept {
    const std::int64_t exact = carry_ + duration;
    std::int64_t rounded = exact / period_;
    std::int64_t rest = exact % period_;
    if (rest < 0) {
      rest += period_;
      --rounded;
    }
    return rest >= period_ - rest ? rounded + 1 : rounded;
  }

  std::int64_t period_;     // [ns]
  std::int64_t carry_ = 0;  // exact end of the queue after the rounded one [ns]
};

}  // namespace o80
