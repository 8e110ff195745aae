#pragma once

#include <atomic>
#include <cstdint>
#include <thread>

#include "memory/os/spinner.hpp"
#include "sample.hpp"

namespace o80::bench {

/// What the machine itself needs to pass a cache line to another processor and back.
///
/// Two lines, one for each way; the answering thread spins on the first all its life.
class PingPong {
 public:
  PingPong() {
    answerer_ = std::thread([this] {
      std::uint64_t seen = 0;
      while (seen != kOver) {
        const std::uint64_t now = ping_.load(std::memory_order_acquire);
        if (now == seen) {
          if (asleep_.load(std::memory_order_relaxed)) asleep_.wait(true);
          pause_processor();
          continue;
        }
        seen = now;
        pong_.store(seen, std::memory_order_release);
      }
    });
  }
  ~PingPong() {
    rest(false);
    ping_.store(kOver, std::memory_order_release);
    answerer_.join();
  }

  /// Leaves the other processor to somebody else, or takes it again.
  void rest(bool asleep) {
    asleep_.store(asleep);
    asleep_.notify_one();
  }

  /// One round trip, `count` times; time of one [ns].
  double round_trip(int count) {
    return nanoseconds([&] {
             for (int i = 0; i < count; ++i) {
               ping_.store(++sent_, std::memory_order_release);
               while (pong_.load(std::memory_order_acquire) != sent_) pause_processor();
             }
           }) /
           count;
  }

 private:
  static constexpr std::uint64_t kOver = ~std::uint64_t{0};
  alignas(128) std::atomic<std::uint64_t> ping_{0};
  alignas(128) std::atomic<std::uint64_t> pong_{0};
  alignas(128) std::atomic<bool> asleep_{true};
  alignas(128) std::uint64_t sent_ = 0;
  std::thread answerer_;
};

}  // namespace o80::bench
