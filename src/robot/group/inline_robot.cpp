#include "robot/group/inline_robot.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "memory/os/futex.hpp"
#include "memory/segment/signal.hpp"
#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr std::uint32_t kMaxAtOnce = 64;           // iterations between reads of the clock
constexpr std::int64_t kLongAtOnce = kSlice / 10;  // [ns] longest time between these looks

BackendOptions bursting(BackendOptions options) {
  options.bursting = true;
  return options;
}
}  // namespace

/// Lock for running iterations, one thread at a time. A waiting thread calls `keep_waiting`.
class InlineRobot::Turn {
 public:
  Turn(InlineRobot& robot, const KeepWaiting& keep_waiting) : robot_(robot) {
    std::atomic<std::uint32_t>& turn = robot.turn_;
    std::uint32_t free = 0;
    if (!turn.compare_exchange_strong(free, 1, std::memory_order_acquire)) {  // sync turn
      while (turn.exchange(2, std::memory_order_acquire) != 0) {              // sync turn
        futex_wait(turn, 2, kSlice);
        if (keep_waiting && !keep_waiting()) {
          throw Cancelled("the wait for '" + robot.segment() + "' was cancelled by the caller");
        }
      }
    }
    robot_.runner_.store(std::this_thread::get_id(), std::memory_order_relaxed);
  }
  Turn& operator=(Turn&&) = delete;
  ~Turn() {
    robot_.runner_.store(std::thread::id(), std::memory_order_relaxed);
    robot_.show_halt();
    if (robot_.turn_.exchange(0, std::memory_order_release) == 2) {  // sync turn
      futex_wake(robot_.turn_, 1);
    }
  }

 private:
  InlineRobot& robot_;
};

InlineRobot::InlineRobot(std::unique_ptr<DriverInstance> robot, BackendOptions options,
                         KeepWaiting keep_waiting, std::shared_ptr<std::atomic<bool>> halted)
    : keep_waiting_(std::move(keep_waiting)),
      halted_(std::move(halted)),
      at_once_(keep_waiting_ ? 1 : kMaxAtOnce),
      loop_(std::move(robot), bursting(std::move(options))) {
  loop_.start();
  show_halt();
}

void InlineRobot::show_halt() noexcept {
  if (!halted_) return;
  const bool halted = loop_.backend().halted().number != 0;
  if (*halted_ != halted) *halted_ = halted;  // seldom written: a group reads those of all copies
}

void InlineRobot::run() {
  const Turn turn(*this, keep_waiting_);
  if (keep_waiting_) polled_at_ = monotonic_now();
  Step step = Step::run;
  while (!stopping_ && (step = loop_.run_granted(at_once_)) == Step::run) poll();
  throw_if_ended(step);
}

std::optional<std::size_t> InlineRobot::run(const DirectBurst& burst, std::span<std::byte> rows) {
  refuse_nested();
  const Turn turn(*this, keep_waiting_);
  if (stopping_ || !loop_.begin_direct(burst)) return {};
  const auto iterations = static_cast<std::size_t>(burst.iterations);
  const std::size_t size = loop_.backend().layout().size;
  // a burst shorter than the next read of the clock needs no clock
  if (keep_waiting_ && iterations >= at_once_) polled_at_ = monotonic_now();
  std::size_t done = 0;
  std::uint32_t unlooked = 0;
  // one step more than iterations: it detects the end of the last one, as run() does
  Step step = Step::run;
  while (!stopping_ && (step = loop_.run_granted(1)) == Step::run) {
    if (done < iterations) std::memcpy(rows.data() + done++ * size, loop_.row(), size);
    if (++unlooked < at_once_) continue;
    unlooked = 0;
    poll();
  }
  throw_if_ended(step);
  return done;
}

void InlineRobot::throw_if_ended(Step step) {
  if (guard_.forked()) guard_.check("the inline robot of '" + segment() + "'");
  if (stopping_) {
    loop_.stop();
    throw Closed("the inline robot of '" + segment() + "' was closed during a burst");
  }
  if (step == Step::ended && !loop_.fault().empty()) throw DriverError(loop_.fault());
}

void InlineRobot::refuse_nested() const {
  if (!runs_here()) return;
  throw Error("this thread already runs a burst of '" + segment() +
              "' (is this a signal handler?): send after the burst, or from another thread");
}

/// Calls `keep_waiting` once every kSlice. The slower the robot, the fewer iterations run between
/// reads of the clock.
void InlineRobot::poll() {
  if (!keep_waiting_) return;
  const std::int64_t now = monotonic_now();
  const std::int64_t took = now - std::exchange(polled_at_, now);
  at_once_ = took > kLongAtOnce ? std::max(1U, at_once_ / 2) : std::min(kMaxAtOnce, at_once_ * 2);
  if (now < poll_at_) return;
  poll_at_ = now + kSlice;
  try {
    if (!keep_waiting_()) {
      throw Cancelled("the burst of '" + segment() + "' was cancelled by the caller");
    }
  } catch (...) {
    loop_.cut_burst();
    throw;
  }
}

void InlineRobot::stop() noexcept {
  if (guard_.forked()) return;  // the hardware belongs to the parent
  stopping_ = true;
  if (runs_here()) return;  // called from `keep_waiting`: run() stops the loop
  const Turn turn(*this, {});
  loop_.stop();
}

void InlineRobot::publish_as(const std::string& name) {
  refuse_nested();
  const Turn turn(*this, keep_waiting_);
  loop_.publish_as(name);
}

std::string unused_segment_name(const std::string& robot) {
  static std::atomic<unsigned> count{0};
  return robot + "-" + std::to_string(getpid()) + "-" + std::to_string(count++);
}

}  // namespace o80
