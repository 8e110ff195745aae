#include "o80/robot/inline_robot.hpp"

#include <unistd.h>

#include <atomic>

#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr std::uint32_t kIterationsAtOnce = 64;  // between looks at the clock

BackendOptions bursting(BackendOptions options) {
  options.bursting = true;
  return options;
}
}  // namespace

InlineRobot::InlineRobot(std::unique_ptr<Robot> robot, BackendOptions options, Check check)
    : check_(std::move(check)), loop_(std::move(robot), bursting(std::move(options))) {
  loop_.start();
}

void InlineRobot::run() {
  const std::scoped_lock lock(running_);
  Step step = Step::run;
  while ((step = loop_.run_granted(kIterationsAtOnce)) == Step::run) look_around();
  if (step == Step::ended && !loop_.fault().empty()) throw DriverError(loop_.fault());
}

/// Asks the check every slice of time.
void InlineRobot::look_around() {
  if (!check_ || monotonic_now() < look_at_) return;
  look_at_ = monotonic_now() + kSlice;
  try {
    if (!check_()) throw Cancelled("the burst of '" + segment() + "' was cut by its caller");
  } catch (...) {
    loop_.cut_burst();
    throw;
  }
}

void InlineRobot::stop() noexcept {
  const std::scoped_lock lock(running_);
  loop_.stop();
}

std::string unused_segment_name(const std::string& robot) {
  static std::atomic<unsigned> count{0};
  return robot + "-" + std::to_string(getpid()) + "-" + std::to_string(count++);
}

}  // namespace o80
