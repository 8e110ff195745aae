#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "o80/base/time.hpp"

namespace o80 {

/// Detects too many late iterations within one second. The count is exact: it keeps the time of
/// each late iteration.
///
/// Realtime: exceeded(); the constructor allocates.
class OverrunLimit {
 public:
  /// `most`: number of late iterations within a second that is too many; 0: no limit.
  explicit OverrunLimit(std::uint32_t most) : times_(most, -kSecond) {}

  std::uint32_t most() const noexcept { return static_cast<std::uint32_t>(times_.size()); }
  /// Records an iteration that was late at `now` [ns]; true if the limit is reached.
  bool exceeded(std::int64_t now) noexcept {
    if (times_.empty()) return false;
    times_[next_] = now;
    next_ = (next_ + 1) % times_.size();
    // times_[next_] is the oldest recorded time
    return count_ + 1 >= times_.size() ? now - times_[next_] < kSecond : (++count_, false);
  }

 private:
  static constexpr std::int64_t kSecond = 1'000'000'000;

  std::vector<std::int64_t> times_;
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

/// Detects that a loop stood still: two rows further apart than a limit. The process was stopped,
/// the machine slept, or a verb of the driver hung.
///
/// Realtime: yes.
class GapLimit {
 public:
  /// `most` [ns]; 0: no limit.
  explicit GapLimit(std::int64_t most) : most_(most) {}

  std::int64_t most() const noexcept { return most_; }
  bool is_on() const noexcept { return most_ > 0; }
  /// Row `iteration` is published at `now` [ns], on a clock that also counts while the machine
  /// sleeps; the time since the row before, if that is too long. What comes before row 1 counts
  /// not: a driver may load something first.
  std::int64_t exceeded(Iteration iteration, std::int64_t now) noexcept {
    const std::int64_t since = now - std::exchange(last_, now);
    return iteration > 1 && since > most_ ? since : 0;
  }

 private:
  std::int64_t most_;
  std::int64_t last_ = 0;
};

}  // namespace o80
