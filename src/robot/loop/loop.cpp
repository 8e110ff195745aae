// The whole idea of o80: an iteration of a robot.
//
// - step: commands => desired. The backend asks its queues; when bursting it waits for a burst.
// - write: desired => hardware, by the driver.
// - pace: in real time only: the end of the period, by the clock or by the robot's own tick.
// - read: hardware => observed, by the driver.
// - publish: desired, observed => row. Whoever waits for the row wakes up.
//
// Row 0 is published before the first iteration: the robot as it was before any command.
#include "robot/loop/loop.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "memory/segment/signal.hpp"
#include "o80/base/time.hpp"

namespace o80 {

Ended Loop::run() noexcept {
  pacer_.begin(monotonic_now());
  while (view_.finished == 0 && backend_.step() == Step::run) {
    if (!iterate()) break;
  }
  brake();
  return stop();
}

Step Loop::run_granted(std::uint32_t most) noexcept {
  if (guard_.forked() || has_ended()) return Step::ended;
  for (std::uint32_t i = 0; i < most; ++i) {
    const Step step = view_.finished != 0 ? Step::ended : backend_.try_step();
    if (step == Step::standing) return step;
    if (step == Step::run && iterate()) continue;
    stop();
    return Step::ended;
  }
  return Step::run;
}

Step Loop::replay(Iteration last) noexcept {
  while (!has_ended() && backend_.iteration() <= last) {
    if (backend_.step() == Step::ended || !iterate()) stop();
  }
  return has_ended() ? Step::ended : Step::run;
}

bool Loop::iterate() noexcept {
  if (!write()) return false;
  if (paced_ && !pace()) return false;
  if (!read()) return false;
  backend_.publish();
  return true;
}

bool Loop::write() noexcept {
  const auto difference = [](const void* backend, std::uint32_t offset, std::uint32_t order) {
    return static_cast<const UntypedBackend*>(backend)->difference(offset, order);
  };
  const DesiredView view{backend_.desired(),
                         backend_.active(),
                         backend_.iteration(),
                         backend_.time(),
                         backend_.schema().head.period,
                         difference,
                         &backend_};
  return calls(Verb::write, [&] { return robot_->write(view); }) || failed("write");
}

/// In real time: waits for the end of the period, or in the driver's wait() for the robot's tick.
bool Loop::pace() noexcept {
  const bool in_time = pacer_.in_time(monotonic_now());
  if (robot_->table().paces_itself != 0) {
    if (!calls(Verb::wait, [&] { return robot_->wait(pacer_.due()); })) return failed("wait");
    backend_.set_timing(pacer_.tick(monotonic_now()));
    if (pacer_.runs_ahead()) hold_back();
    return true;
  }
  // A signal may arrive just before the sleep, so a long sleep is cut into slices. While the robot
  // moves, a stop does not shorten the period: the robot would have to move faster.
  bool over = !in_time;
  const bool moves = backend_.acts() && backend_.schema().head.period <= kLongestBraking;
  while (!over && (moves || !backend_.stop_asked() || backend_.phase() == Phase::braking)) {
    const std::int64_t slice = std::min(pacer_.due(), monotonic_now() + kSlice);
    over = sleep_until(slice) && slice == pacer_.due();
  }
  backend_.set_timing(pacer_.next(monotonic_now()));
  return true;
}

bool Loop::read() noexcept {
  view_.observed = backend_.observed();
  view_.extended = backend_.extended();
  view_.desired = nullptr;
  if (!read_into_view()) return false;
  if (paced_ && view_.missed != 0) backend_.set_timing(pacer_.missed());
  for (std::uint32_t word = 0; word < interrupted_.size(); ++word) {
    if (interrupted_[word] == 0) continue;
    for (std::uint64_t bits = std::exchange(interrupted_[word], 0); bits != 0; bits &= bits - 1) {
      const auto actuator = word * 64 + static_cast<std::uint32_t>(std::countr_zero(bits));
      if (actuator < backend_.schema().actuators.size()) backend_.interrupt(actuator);
    }
  }
  return true;
}

/// Reads into the places that `view_` names. `interrupted_` is zero before.
bool Loop::read_into_view() noexcept {
  view_.iteration = backend_.iteration();
  view_.time = backend_.time();
  const std::uint32_t finished = view_.finished;  // stays set
  view_.finished = view_.has_desired = view_.follows = view_.missed = view_.halted =
      view_.reported = 0;
  view_.halt_text.text[0] = 0;
  // reports change only while requests run, and by drivers that say so
  if (const bool any = backend_.runs_any(); any || reported_) {
    for (std::uint32_t i = 0; i < reports_.size(); ++i) {
      reports_[i].runs = backend_.runs(i) ? 1 : 0;
      reports_[i].changed = 0;
    }
    reported_ = any;
  }
  const bool reads = calls(Verb::read, [&] { return robot_->read(view_); });
  view_.finished = (reads ? view_.finished : 0) | finished;
  if (!reads) return failed("read");
  if (view_.halted != 0) note_halt(view_);
  reported_ = reported_ || view_.reported != 0;
  if (view_.reported != 0) note_requests(view_);
  return true;
}

/// Before an end in order in real time: brakes all actuators, for at most one second. Not after a
/// failed function of the driver.
void Loop::brake() noexcept {
  if (!paced_ || !fault_.empty()) return;
  const std::int64_t end = monotonic_now() + kLongestBraking;
  while (monotonic_now() < end && backend_.brake() == Step::run) {
    if (!iterate()) return;
  }
}

void Loop::end_by_exit() noexcept {
  if (fault_.empty()) fault_ = "the driver, or a library that it uses, called exit()";
  stop();
}

Ended Loop::stop() noexcept {
  if (!has_ended()) {
    calls(Verb::stop, [&] {
      robot_->stop();
      return true;
    });
    if (fault_.empty()) fault_ = backend_.failure();
    backend_.end(fault_.empty() ? BackendState::stopped : BackendState::failed, fault_);
  }
  return {fault_.empty(), fault_};
}

}  // namespace o80
