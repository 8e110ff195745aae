#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace o80 {

/// Number of an iteration of a backend, from 0. Rows, commands and statuses refer to it.
using Iteration = std::int64_t;

/// The monotonic clock [ns].
std::int64_t monotonic_now() noexcept;
/// The monotonic clock, which also counts while the machine sleeps [ns].
std::int64_t boot_now() noexcept;
/// The wall clock: time since 1970 [ns].
std::int64_t wall_clock_now() noexcept;
/// The coarse monotonic clock: up to some milliseconds old, but cheap to read [ns].
std::int64_t monotonic_roughly_now() noexcept;

/// Longest duration of a wait; empty: no timeout.
using Timeout = std::optional<std::chrono::nanoseconds>;

/// Time at which a wait times out.
class Deadline {
 public:
  explicit Deadline(Timeout timeout) noexcept;
  bool over() const noexcept;
  /// Time until the deadline [ns], from 0 to `cap`.
  std::int64_t left(std::int64_t cap) const noexcept;

 private:
  std::int64_t end_;
};

}  // namespace o80
