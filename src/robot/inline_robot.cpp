#include "o80/robot/inline_robot.hpp"

#include <unistd.h>

#include <atomic>

#include "o80/base/error.hpp"

namespace o80 {

namespace {
BackendOptions bursting(BackendOptions options) {
  options.bursting = true;
  return options;
}
}  // namespace

InlineRobot::InlineRobot(std::unique_ptr<Robot> robot, BackendOptions options)
    : loop_(std::move(robot), bursting(std::move(options))) {
  loop_.start();
}

void InlineRobot::run() {
  const std::scoped_lock lock(running_);
  if (!loop_.run_granted() && !loop_.fault().empty()) throw DriverError(loop_.fault());
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
