#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>

#include "o80/runtime/frontend.hpp"
#include "robot/loop.hpp"
#include "runtime/inline_runner.hpp"

namespace o80 {

/// A bursting robot inside the caller's process: bursts run in the thread that asks for them.
///
/// Others may attach to its segment, watch it and command it; what they send is taken when the
/// owner next bursts or pulses.
class InlineRobot final : public InlineRunner {
 public:
  /// Starts the robot. `keep_waiting` is asked now and then in a burst; if it is false or throws,
  /// the rest of the burst is not run. Throws as Loop.
  InlineRobot(std::unique_ptr<Robot> robot, BackendOptions options, KeepWaiting keep_waiting = {});

  /// Threads run one after the other. Throws DriverError, Closed if `stop` cut it.
  void run() override;
  void refuse_nested() const override;
  bool runs_here() const noexcept override {
    return runner_.load(std::memory_order_relaxed) == std::this_thread::get_id();
  }
  /// Stops the robot, at the next iteration of a burst that runs; its frontends see a backend that
  /// stopped. From any thread, also from within `keep_waiting`; does nothing in a forked child.
  void stop() noexcept;
  const std::string& segment() const noexcept { return loop_.backend().name(); }

 private:
  class Turn;
  void look_around();

  std::atomic<std::uint32_t> turn_{0};     // taken by Turn: 0 free, 1 taken, 2 taken and waited for
  std::atomic<std::thread::id> runner_{};  // who runs iterations: each thread asks for itself only
  std::atomic<bool> stopping_{false};
  ForkGuard guard_;
  KeepWaiting keep_waiting_;
  std::int64_t look_at_ = 0;    // when `keep_waiting` is asked next [ns]
  std::int64_t looked_at_ = 0;  // the clock, last [ns]
  std::uint32_t at_once_;       // iterations between looks at the clock
  Loop loop_;
};

/// An unused segment name for a robot inside this process.
std::string unused_segment_name(const std::string& robot);

}  // namespace o80
