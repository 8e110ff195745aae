#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <thread>

#include "o80/runtime/frontend.hpp"
#include "robot/loop/loop.hpp"
#include "runtime/backend/direct_burst.hpp"
#include "runtime/protocol/inline_runner.hpp"

namespace o80 {

/// A bursting robot inside the caller's process: a burst runs in the thread that requests it.
///
/// Other processes may attach to its segment, observe it and send commands. Their batches are taken
/// when the owner bursts or pulses next.
class InlineRobot final : public InlineRunner {
 public:
  /// Starts the robot. `keep_waiting` is called about every 50 ms of a burst; if it returns false
  /// or throws, the rest of the burst is cancelled. `halted`, if any, tells after each run whether
  /// a halt is in force. Throws as Loop.
  InlineRobot(std::unique_ptr<DriverInstance> robot, BackendOptions options,
              KeepWaiting keep_waiting = {}, std::shared_ptr<std::atomic<bool>> halted = {});

  /// Runs granted iterations; threads take turns. Throws DriverError, and Closed after `stop`.
  void run() override;
  /// Runs a direct burst and copies its rows; returns their number, which is less than its
  /// iterations if a halt or the end of the robot has cut it. Empty, without an iteration, if a
  /// batch is needed instead (UntypedBackend::begin_direct). Throws as run().
  std::optional<std::size_t> run(const DirectBurst& burst, std::span<std::byte> rows);
  void refuse_nested() const override;
  bool runs_here() const noexcept override {
    return runner_.load(std::memory_order_relaxed) == std::this_thread::get_id();
  }
  /// Stops the robot, during a burst before its next iteration; frontends then raise
  /// BackendStopped. From any thread, also from within `keep_waiting`; no effect in a forked child.
  void stop() noexcept;
  const std::string& segment() const noexcept { return loop_.backend().name(); }
  const UntypedBackend& backend() const noexcept { return loop_.backend(); }
  /// Names an anonymous segment (BackendOptions::anonymous) between two iterations.
  void publish_as(const std::string& name);

 private:
  class Turn;
  void poll();
  void throw_if_ended(Step step);
  void show_halt() noexcept;

  std::atomic<std::uint32_t> turn_{0};     // futex lock of Turn: 0 free, 1 held, 2 contended
  std::atomic<std::thread::id> runner_{};  // the thread that runs iterations
  std::atomic<bool> stopping_{false};
  ForkGuard guard_;
  KeepWaiting keep_waiting_;
  std::shared_ptr<std::atomic<bool>> halted_;
  std::int64_t poll_at_ = 0;    // time of the next call of `keep_waiting` [ns]
  std::int64_t polled_at_ = 0;  // time of the last read of the clock [ns]
  std::uint32_t at_once_;       // iterations between reads of the clock
  Loop loop_;
};

/// An unused segment name for a robot inside this process.
std::string unused_segment_name(const std::string& robot);

}  // namespace o80
