#pragma once

#include <cstdint>
#include <vector>

namespace o80 {

/// Notices when too many iterations are late within a second, counted exactly.
///
/// Realtime: yes, but for construction.
class OverrunLimit {
 public:
  /// `most` late iterations within a second are too many; 0: there is no limit.
  explicit OverrunLimit(std::uint32_t most) : times_(most, -kSecond) {}

  std::uint32_t most() const noexcept { return static_cast<std::uint32_t>(times_.size()); }
  /// An iteration was late, now [ns]; true if that is one too many.
  bool exceeded(std::int64_t now) noexcept {
    if (times_.empty()) return false;
    times_[next_] = now;
    next_ = (next_ + 1) % times_.size();
    // the oldest of so many
    return count_ + 1 >= times_.size() ? now - times_[next_] < kSecond : (++count_, false);
  }

 private:
  static constexpr std::int64_t kSecond = 1'000'000'000;

  std::vector<std::int64_t> times_;
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

}  // namespace o80
