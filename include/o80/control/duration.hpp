#pragma once

#include <cstdint>

namespace o80 {

/// Turns durations into whole numbers of iterations such that their sum never drifts.
///
/// What rounding added or took away is carried to the next duration of an unbroken queue.
class DurationCarry {
 public:
  explicit DurationCarry(std::int64_t period = 1) noexcept : period_(period > 0 ? period : 1) {}

  /// Iterations of the next duration [ns]; at least 1, and then nothing is carried on.
  std::int64_t iterations(std::int64_t duration) noexcept {
    const std::int64_t exact = carry_ + duration;
    std::int64_t rounded = exact / period_;
    std::int64_t rest = exact % period_;
    if (rest < 0) {
      rest += period_;
      --rounded;
    }
    if (rest >= period_ - rest) {
      rest -= period_;
      ++rounded;
    }
    carry_ = rounded < 1 ? 0 : rest;
    return rounded < 1 ? 1 : rounded;
  }
  void reset() noexcept { carry_ = 0; }

 private:
  std::int64_t period_;     // [ns]
  std::int64_t carry_ = 0;  // exact end of the queue after the rounded one [ns]
};

}  // namespace o80
