// Direct bursts, which an inline group runs without a batch. See src/runtime/README.md#bursts.

#include "runtime/backend/backend_body.hpp"
#include "runtime/backend/direct_burst.hpp"

namespace o80 {

/// True if nothing but the present frontend of the loop's thread acts: then a direct burst does
/// what a batch would do. Where a journal is written, batches are needed for their entries.
bool UntypedBackend::Body::is_undisturbed() const noexcept {
  const bool alone = recorded == nullptr && !journal.is_on() && !commanders.has_watchdog();
  const bool calm = !halts.acts() && commanders.holder().is_nobody() && !bursts.runs();
  const bool nothing_waits =
      !intake.busy() && schedule.empty() && !schedule.has_aside() && !running.any();
  return alone && calm && nothing_waits && lanes.are_quiet() &&
         !stop.load(std::memory_order_relaxed);
}

/// As a step that takes a batch: first what has happened since the last iteration.
bool UntypedBackend::Body::begin_direct(const DirectBurst& burst) noexcept {
  watch();
  if (!is_undisturbed() || !controller.has_no_command(burst.targets.actuators)) return false;
  while (!controller.finish_pending()) {
  }
  bursts.begin_direct(burst.iterations);
  DirectTargets targets = burst.targets;
  targets.first = current + burst.delay;
  controller.give(targets);
  return true;
}

/// An iteration of a direct burst.
Step UntypedBackend::Body::step_direct() noexcept {
  commanders.poll_liveness();
  halts.watch();
  if (stop.load(std::memory_order_relaxed)) return Step::ended;
  if (!bursts.runs()) return Step::standing;  // cut by the halt
  move(Phase::iterating);
  return Step::run;
}

bool UntypedBackend::begin_direct(const DirectBurst& burst) noexcept {
  return body_->begin_direct(burst);
}

}  // namespace o80
