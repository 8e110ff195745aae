#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace o80 {

/// The count of backend loops: the clock of everything.
using Iteration = std::int64_t;

/// Nanoseconds of the monotonic clock [ns].
std::int64_t monotonic_now() noexcept;
/// The same clock as of the last tick of the kernel, some milliseconds late but a load away [ns].
std::int64_t monotonic_roughly_now() noexcept;

/// How long a caller is ready to wait; empty is for ever.
using Timeout = std::optional<std::chrono::nanoseconds>;

/// The moment at which a wait gives up.
class Deadline {
 public:
  explicit Deadline(Timeout timeout) noexcept;
  bool over() const noexcept;
  /// What is left [ns], never below 0, at most `cap`.
  std::int64_t left(std::int64_t cap) const noexcept;

 private:
  std::int64_t end_;
};

}  // namespace o80
