#pragma once

#include <atomic>
#include <cstdint>
#include <limits>

#include "o80/base/time.hpp"

namespace o80 {

/// The pause instruction of a spin loop.
inline void pause_processor() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

/// Decides whether and how a wait spins before it sleeps; one object for each waiting object.
///
/// - With a single processor no wait spins.
/// - After 8 failed spins in a row only one wait in 64 spins (a probe). A success restores it.
/// - A spin longer than 4 us yields between its checks, because more threads may spin than there
/// are
///   processors (a learner, its arm and its twin on two). While yields let other threads run, spins
///   yield from their beginning.
/// - A probe does not yield. After a yield of more than 1 ms the next 1024 waits do not yield.
///
/// Writer / Readers: any threads of one process; races between them are harmless.
/// Realtime: yes; a spin takes up to `longest`.
class Spinner {
 public:
  static constexpr std::int64_t kLongest = 50'000;      // longest spin, unless it is given [ns]
  static constexpr std::uint32_t kPatience = 8;         // failed spins before only probes spin
  static constexpr std::uint32_t kProbe = 64;           // waits from one probe to the next
  static constexpr std::int64_t kAlone = 4'000;         // spin before the first yield [ns]
  static constexpr std::int64_t kSwitched = 900;        // a shorter yield ran no other thread [ns]
  static constexpr std::uint32_t kQuiet = 64;           // yields without effect: nobody competes
  static constexpr std::int64_t kTooLong = 1'000'000;   // a longer yield stops yielding [ns]
  static constexpr std::uint32_t kYieldHoldoff = 1024;  // waits without a yield after that

  Spinner() noexcept;
  /// One whose spins last up to `longest` [ns].
  static Spinner lasting(std::int64_t longest) noexcept;
  /// With a given number of processors, for tests.
  explicit Spinner(int processors, std::int64_t longest = kLongest) noexcept
      : processors_(processors), longest_(longest) {}

  /// Whether this wait should spin.
  bool should_spin() noexcept;
  void ended(bool success) noexcept;

  /// Spins until done() is true, at most `longest`; true if done. Calls done() at least once.
  template <class Done>
  bool spin(Done&& done) noexcept {
    if (done()) return true;
    if (!should_spin()) return false;
    const std::int64_t begin = monotonic_now();
    std::int64_t now = begin;
    do {
      for (int i = 0; i < 16; ++i) {
        pause_processor();
        if (done()) {
          ended(true);
          return true;
        }
      }
      now = monotonic_now();
      if (now - begin >= patience()) now = let_others_run(now);
    } while (now - begin < longest_);
    const bool success = done();
    ended(success);
    return success;
  }

 private:
  /// How long to spin before the first yield [ns].
  std::int64_t patience() const noexcept {
    const bool hopeful = failures_.load(std::memory_order_relaxed) < kPatience;
    if (!hopeful || yield_holdoff_.load(std::memory_order_relaxed) > 0)
      return std::numeric_limits<std::int64_t>::max();  // never
    return quiet_.load(std::memory_order_relaxed) < kQuiet ? 0 : kAlone;
  }
  /// Yields; returns the time after it.
  std::int64_t let_others_run(std::int64_t now) noexcept;

  int processors_;
  std::int64_t longest_;                         // [ns]
  std::atomic<std::uint32_t> quiet_{kQuiet};     // yields without effect in a row
  std::atomic<std::uint32_t> yield_holdoff_{0};  // remaining waits without a yield
  std::atomic<std::uint32_t> failures_{0};
  std::atomic<std::uint32_t> refused_{0};
};

}  // namespace o80
