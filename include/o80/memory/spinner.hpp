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

/// Decides whether spinning before a sleep is worth it; one for each waiting object.
///
/// Never if the process was given a single processor. Eight spins in a row without success stop
/// it; from then on one wait in 64 probes; one success restores it.
///
/// Writer / Readers: any threads of one process (an answer from a race is as good as another).
/// Realtime: yes, up to `kLongest` a spin.
class Spinner {
 public:
  static constexpr std::int64_t kLongest = 50'000;  // [ns]
  static constexpr std::uint32_t kPatience = 8;     // spins
  static constexpr std::uint32_t kProbe = 64;       // waits

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
    const std::int64_t end = monotonic_now() + kLongest;
    do {
      for (int i = 0; i < 16; ++i) {
        pause_processor();
        if (done()) {
          ended(true);
          return true;
        }
      }
    } while (monotonic_now() < end);
    ended(false);
    return false;
  }

 private:
  int processors_;
  std::atomic<std::uint32_t> failures_{0};
  std::atomic<std::uint32_t> refused_{0};
};

}  // namespace o80
