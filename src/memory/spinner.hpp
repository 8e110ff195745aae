#pragma once

#include <atomic>
#include <cstdint>

#include "o80/base/time.hpp"

namespace o80 {

/// Tells the processor that this is a spin.
inline void pause_processor() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

/// Decides whether spinning before a sleep is worth it, and how; one for each waiting object.
///
/// Never if the process was given a single processor. Eight spins in a row without success stop
/// it; from then on one wait in 64 probes; one success restores it.
///
/// More may spin than there are processors (a learner, its arm and its twin on two). So a spin that
/// lasts lets others run in between, and while that helps somebody it does so from its beginning.
/// A probe does not; nor does anyone for the next 1024 waits who was kept from running for long.
///
/// Writer / Readers: any threads of one process (an answer from a race is as good as another).
/// Realtime: yes, up to `kLongest` a spin.
class Spinner {
 public:
  static constexpr std::int64_t kLongest = 50'000;      // [ns]
  static constexpr std::uint32_t kPatience = 8;         // spins
  static constexpr std::uint32_t kProbe = 64;           // waits
  static constexpr std::int64_t kAlone = 4'000;         // spun before others may run [ns]
  static constexpr std::int64_t kSwitched = 900;        // letting nobody run takes less [ns]
  static constexpr std::uint32_t kQuiet = 64;           // yields to nobody: it is alone
  static constexpr std::int64_t kTooLong = 1'000'000;   // away in a yield [ns]
  static constexpr std::uint32_t kYieldHoldoff = 1024;  // waits without a yield, after that

  Spinner() noexcept;
  /// With a given number of processors, for tests.
  explicit Spinner(int processors) noexcept : processors_(processors) {}

  /// Whether this wait should spin.
  bool worth() noexcept;
  void ended(bool success) noexcept;

  /// Spins until `done()` or for `kLongest`; true if done. Looks at least once.
  template <class Done>
  bool spin(Done&& done) noexcept {
    if (done()) return true;
    if (!worth()) return false;
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
    } while (now - begin < kLongest);
    const bool success = done();
    ended(success);
    return success;
  }

 private:
  /// How long to spin before others may run [ns].
  std::int64_t patience() const noexcept {
    const bool hopeful = failures_.load(std::memory_order_relaxed) < kPatience;
    if (!hopeful || yield_holdoff_.load(std::memory_order_relaxed) > 0)
      return 2 * kLongest;  // never
    return quiet_.load(std::memory_order_relaxed) < kQuiet ? 0 : kAlone;
  }
  /// Returns the time after it.
  std::int64_t let_others_run(std::int64_t now) noexcept;

  int processors_;
  std::atomic<std::uint32_t> quiet_{kQuiet};     // yields in a row to nobody
  std::atomic<std::uint32_t> yield_holdoff_{0};  // waits that are left without a yield
  std::atomic<std::uint32_t> failures_{0};
  std::atomic<std::uint32_t> refused_{0};
};

}  // namespace o80
