#pragma once

#include <cstdint>
#include <vector>

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

}  // namespace o80
