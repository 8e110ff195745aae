#pragma once

#include <memory>
#include <mutex>

#include "o80/robot/loop.hpp"
#include "o80/runtime/frontend.hpp"

namespace o80 {

/// A bursting robot inside the caller's process: bursts run in the thread that asks for them.
///
/// Others may attach to its segment, watch it and command it; what they send is taken when the
/// owner next bursts or pulses.
class InlineRobot final : public InlineRunner {
 public:
  /// Starts the robot. `check` is asked now and then in a burst; if it is false or throws, the rest
  /// of the burst is not run. Throws as Loop.
  InlineRobot(std::unique_ptr<Robot> robot, BackendOptions options, Check check = {});

  void run() override;
  /// Stops the robot; its frontends see a backend that stopped.
  void stop() noexcept;
  const std::string& segment() const noexcept { return loop_.backend().name(); }

 private:
  void look_around();

  std::mutex running_;
  Check check_;
  std::int64_t look_at_ = 0;  // when `check` is asked next [ns]
  Loop loop_;
};

/// An unused segment name for a robot inside this process.
std::string unused_segment_name(const std::string& robot);

}  // namespace o80
