#include "o80/runtime/backend.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <type_traits>

#include "base/crash_point.hpp"
#include "runtime/backend/backend_body.hpp"
#include "runtime/backend/backend_options.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kForEver = std::numeric_limits<std::int64_t>::max();

std::size_t largest_request(const Schema& schema) {
  std::size_t size = 0;
  for (const RequestRow& row : schema.requests) {
    size = std::max<std::size_t>(size, schema.types[row.type].size);
  }
  return size;
}

/// Options for a backend that nobody halts or reads the journal of.
BackendOptions replaying(BackendOptions options) {
  options.resume = true;  // halts come from the recording
  options.journal = 0;
  return options;
}

}  // namespace

UntypedBackend::Body::Body(Schema&& given, const BackendOptions& options,
                           RequestServer* server_or_null, RecordedDecisions* recorded_or_null)
    : BackendCore(std::move(given), options, server_or_null, recorded_or_null, *this),
      bursts(*this),
      readings(*this, options),
      halts(*this, bursts, readings, options),
      commanders(*this, bursts, halts, options),
      intake(*this, bursts, readings, halts, commanders, *this),
      // ends of commands in one step: completed and late ones, and those of their batches
      outbox(lanes, journal, 2 * (schema.actuators.size() + 2 * Controller::kStatusesPerIteration)),
      verbs(segment.view()),
      payload_(largest_request(schema), std::byte{0}),
      fresh_desired_(layout.block / 8) {}

// ------------------------------------------------------------------------------ state and time

/// True in a child that was forked since: the robot and the segment belong to its parent.
bool UntypedBackend::Body::is_in_forked_child() noexcept {
  if (!guard.forked()) return false;
  note_failure("this process was forked: the backend belongs to its parent");
  return true;
}

// ------------------------------------------------------------------------------ step

/// Commands => desired, in four stages: watch, take, wait, move. A bursting backend waits at most
/// `at_most` [ns] for a burst.
Step UntypedBackend::Body::step(std::int64_t at_most) noexcept {
  if (recorded != nullptr) return step_recorded();
  if (bursts.is_direct()) return step_direct();
  const std::int64_t give_up =
      at_most > 0 && at_most < kForEver ? monotonic_now() + at_most : at_most;
  const bool waited = !bursts.is_granted();
  std::uint32_t scans = 0;
  while (true) {
    watch();
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    take_commands();
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    if (bursts.is_granted()) {
      // a pulse that came in this step is a sign of life; a halt may end the burst
      commanders.watch_silence();
      halts.watch();
      if (bursts.is_granted()) break;
    }
    if (!wait_for_burst(give_up, scans)) return Step::standing;
  }
  O80_CRASH_POINT("backend.after_take");
  if (bursts.runs()) begin_iteration_of_burst(waited);
  move(Phase::iterating);
  show_acts();
  O80_CRASH_POINT("backend.after_step");
  return Step::run;
}

/// Deaths and halts => ended commands. Then the fresh start that an ended request needs.
void UntypedBackend::Body::watch() noexcept {
  commanders.poll_liveness();
  halts.watch();
  if (running.any()) start_afresh_after_request();
}

/// Batches => queues, within the budget of an iteration; none during a burst.
void UntypedBackend::Body::take_commands() noexcept {
  intake.begin_iteration();
  if (bursts.runs()) return;
  intake.take_due();
  intake.take_new();
}

/// Waits for the bell, until `give_up` [ns]; false if that is over. First reports all pending
/// statuses. `scans` counts scans of the lanes that found invalid blocks.
bool UntypedBackend::Body::wait_for_burst(std::int64_t give_up, std::uint32_t& scans) noexcept {
  const bool all_told = controller.finish_pending();
  journal.flush();
  wake_sleepers(segment.view(), {.lanes = lanes.announce()});
  if (intake.busy() || !all_told) return true;
  // invalid blocks may have used up the budget of this scan: scan again, a limited number of times
  const std::uint32_t max_scans = 2 + pool.size() / kWorkPerIteration;
  if (lanes.has_pending() && ++scans < max_scans) return true;
  const std::int64_t left = give_up > 0 && give_up < kForEver ? give_up - monotonic_now() : give_up;
  if (left <= 0) return false;
  bell.wait(lanes.bell_seen(), std::min(left, kSlice));
  return true;
}

/// Batches that are due in this iteration of a burst => queues. `first`: the burst has just begun.
void UntypedBackend::Body::begin_iteration_of_burst(bool first) noexcept {
  // A group command waits until its dropped members are reported. Report all of them first, so that
  // a burst does not depend on how long the backend has waited before.
  while (first && !controller.finish_pending()) {
  }
  if (!bursts.runs()) return;  // its commands have ended
  intake.begin_iteration();
  intake.take_due();
  if (bursts.is_in_last_iteration()) history.expect(current);
}

/// Queues => desired.
void UntypedBackend::Body::move(Phase under_way) noexcept {
  enter(under_way);
  outbox.begin_step();
  controller.step(current, row() + layout.observed);
  outbox.end_step();
}

/// Updates Counters::acts before the desired states are written. If this backend is killed while
/// commands act, its successor starts halted.
void UntypedBackend::Body::show_acts() noexcept {
  if (schema.head.bursting != 0) return;
  const std::uint64_t* active = controller.active_mask();
  const bool moves = running.moves() || std::any_of(active, active + layout.mask_words,
                                                    [](std::uint64_t word) { return word != 0; });
  const bool stays =
      moves || !commanders.holder().is_nobody() || (shown_acts_ != 0 && controller.holds());
  const std::uint32_t acts = stays ? 1 : 0;
  if (acts == shown_acts_) return;
  shown_acts_ = acts;
  segment.view().counters().acts.store(acts, std::memory_order_relaxed);
}

/// One iteration before an end in order: commands have ended, actuators brake.
Step UntypedBackend::Body::brake() noexcept {
  if (phase == Phase::stopping || phase == Phase::braking) {
    if (!controller.braking()) return Step::ended;
  } else {
    const bool is_unreadable = phase == Phase::unreadable;
    enter(Phase::stopping);
    journal.stopping();
    if (is_unreadable) return Step::ended;  // the position is unknown, so the robot cannot brake
    const bool acted = acts();
    purge_to_stop();
    if (!acted) return Step::ended;
  }
  move(Phase::braking);
  return Step::run;
}

void UntypedBackend::Body::purge_to_stop() noexcept {
  controller.purge(kEveryActuator, current, Reason::stopped);
  drop_running({Status::purged, Reason::stopped});
}

// ------------------------------------------------------------------------------ publish

bool UntypedBackend::Body::publish_first() noexcept {
  if (!readings.can_begin(row() + layout.observed, "the first reading")) return false;
  if (!readings.agrees_with_first()) return false;
  if (!stop.load(std::memory_order_relaxed)) failure[0] = 0;  // that of a row 0 refused before
  publish(false);
  return true;
}

/// Reading, desired states => row. Then statuses, and whoever waits is woken. `fresh`: the row of a
/// fresh start, which comes within a step.
void UntypedBackend::Body::publish(bool fresh) noexcept {
  if (!has_begun()) {
    controller.restart(row() + layout.observed, begins_with, current);
    if (recorded == nullptr) {
      halts.watch();
    } else {
      obey_recorded();
    }
  }
  fill_row(fresh);
  history.publish(current, row());
  if (timing.next_due != 0) row_signal.expect_next(timing.next_due, schema.head.period);
  watch_row(fresh);
  report_ended_requests(fresh);
  if (!fresh) end_iteration();
  journal.flush();
  wake_sleepers(segment.view(),
                {.lanes = !fresh && lanes.announce(), .rows = row_signal.announce(current)});
  if (!has_begun()) {
    segment.set_state(BackendState::running);
    enter(Phase::ready);
  }
  journal.set_iteration(++current);
}

/// Adds head, desired states and masks: observed and extended are in the row already.
void UntypedBackend::Body::fill_row(bool fresh) noexcept {
  RowHead head;
  head.iteration = current;
  head.time = time();
  head.lateness = timing.lateness;
  head.overruns = timing.overruns;
  head.skipped = timing.skipped;
  head.fresh = fresh ? 1 : 0;
  head.halted = halts.acts() ? 1 : 0;
  head.starvations = controller.starvations();
  std::memcpy(row(), &head, sizeof head);
  if (layout.block > 0) std::memcpy(row() + layout.desired, controller.desired(), layout.block);
  const auto put_masks = [&](auto bytes) {
    std::memcpy(row() + layout.active, controller.active_mask(), bytes);
    std::memcpy(row() + layout.clamped, controller.clamped_mask(), bytes);
    std::memcpy(row() + layout.braking, controller.braking_mask(), bytes);
    std::memcpy(row() + layout.starved, controller.starved_mask(), bytes);
  };
  if (layout.mask_words == 1) {  // mostly: no calls
    put_masks(std::integral_constant<std::size_t, 8>());
  } else if (layout.mask_words > 1) {
    put_masks(layout.mask_words * std::size_t{8});
  }
  if (layout.off_plan < layout.size)
    std::memcpy(row() + layout.off_plan, controller.off_plan(), layout.size - layout.off_plan);
}

/// Row => halts: error limits, readings, gaps.
void UntypedBackend::Body::watch_row(bool fresh) noexcept {
  // before a fresh start the robot may be away from its desired states
  if (halts.has_error_limits() && has_begun() && !fresh && !will_start_afresh()) {
    halts.watch_errors();
  }
  if (halts.acts()) readings.add();
  readings.watch_followers(fresh);
  halts.watch_gaps(fresh);
}

/// Status => outbox. A burst may run until its batch has ended (pulse_to_end).
void UntypedBackend::Body::changed(const StatusChange& change) noexcept {
  if (change.of == StatusChange::Of::batch && deciding != nullptr) {
    journal.decided(*deciding, change);
  }
  outbox.put(change);
  if (bursts.ends_with(change.lane, change.id)) bursts.stop();
}

/// Reports the statuses that belong to the row, and counts the iteration of a burst.
void UntypedBackend::Body::end_iteration() noexcept {
  outbox.report_row();
  controller.finish_pending();
  if (phase == Phase::iterating) {
    enter(Phase::ready);
  } else if (phase == Phase::braking) {
    enter(Phase::stopping);
  }
  bursts.count_iteration();
  if (journal.lacks_rest() && is_at_rest()) journal.at_rest();
}

void UntypedBackend::Body::end(BackendState state, std::string_view text) noexcept {
  if (guard.forked()) return;  // only the parent ends its backend
  if (phase == Phase::ended) return;
  enter(Phase::ended);
  // the current burst gets no last row: its waiter raises BackendGone
  bursts.end();
  intake.reject_all(Reason::stopped);
  outbox.report_no_row();
  purge_to_stop();
  while (!controller.finish_pending()) {
  }
  wake_sleepers(segment.view(), {.lanes = lanes.announce()});
  segment.view().counters().acts.store(0, std::memory_order_relaxed);
  journal.ended(state, text);
  segment.end(state, text);
}

// ------------------------------------------------------------------------------

UntypedBackend::UntypedBackend(Schema schema, const BackendOptions& options, RequestServer* server,
                               RecordedDecisions* recorded)
    : body_(std::make_unique<Body>(std::move(schema),
                                   recorded == nullptr ? options : replaying(options), server,
                                   recorded)) {}

UntypedBackend::~UntypedBackend() {
  body_->end(failure().empty() ? BackendState::stopped : BackendState::failed, failure());
}

const Schema& UntypedBackend::schema() const noexcept { return body_->schema; }
const RowLayout& UntypedBackend::layout() const noexcept { return body_->layout; }
const std::string& UntypedBackend::name() const noexcept { return body_->segment.name(); }
const Provenance& UntypedBackend::provenance() const noexcept { return body_->provenance; }
const OwnedSegment& UntypedBackend::segment() const noexcept { return body_->segment; }
void UntypedBackend::publish_as(const std::string& name) { body_->segment.publish(name); }

std::byte* UntypedBackend::observed() noexcept { return body_->row() + body_->layout.observed; }
std::byte* UntypedBackend::extended() noexcept { return body_->row() + body_->layout.extended; }
bool UntypedBackend::watches_readings() const noexcept { return !body_->readings.empty(); }
bool UntypedBackend::judge_first(bool again) noexcept { return body_->readings.judge_first(again); }
bool UntypedBackend::publish() noexcept {
  if (body_->is_in_forked_child()) return false;
  if (!body_->has_begun()) return body_->publish_first();
  if (!body_->readings.agrees_with_first()) return false;
  body_->publish(false);
  return true;
}

void UntypedBackend::begin_at(Iteration first, const std::byte* desired) noexcept {
  body_->current = first;
  body_->begins_with = desired;
}

Step UntypedBackend::step() noexcept { return step_within(kForEver); }
Step UntypedBackend::try_step() noexcept { return step_within(0); }
Step UntypedBackend::step_within(std::int64_t at_most) noexcept {
  if (body_->is_in_forked_child()) return Step::ended;
  return body_->step(std::max<std::int64_t>(at_most, 0));
}
void UntypedBackend::cut_burst() noexcept { body_->bursts.stop(); }
const std::byte* UntypedBackend::desired() const noexcept { return body_->controller.desired(); }
const std::uint64_t* UntypedBackend::active() const noexcept {
  return body_->controller.active_mask();
}
double UntypedBackend::difference(std::uint32_t offset, std::uint32_t order) const noexcept {
  return body_->controller.difference(offset, order);
}
const std::uint64_t* UntypedBackend::braking() const noexcept {
  return body_->controller.braking_mask();
}
Phase UntypedBackend::phase() const noexcept { return body_->phase; }
Iteration UntypedBackend::iteration() const noexcept { return body_->current; }
std::int64_t UntypedBackend::time() const noexcept { return body_->time(); }
void UntypedBackend::set_timing(const Timing& timing) noexcept { body_->halts.set_timing(timing); }
Step UntypedBackend::brake() noexcept {
  return body_->is_in_forked_child() ? Step::ended : body_->brake();
}
bool UntypedBackend::acts() const noexcept { return body_->acts(); }
void UntypedBackend::enter(Verb verb) noexcept { body_->verbs.enter(verb); }
void UntypedBackend::leave() noexcept { body_->verbs.leave(); }

void UntypedBackend::halt(HaltCause cause, std::string_view text) noexcept {
  body_->halts.request(cause, text);
}
const Halt& UntypedBackend::halted() const noexcept { return body_->halts.halt(); }

void UntypedBackend::end_request(std::uint32_t request, const Served& how) noexcept {
  if (how.kind == Served::Kind::running) return body_->running.show_progress(request, how.why());
  body_->running.note_end(request, how);
}
void UntypedBackend::show_progress(std::uint32_t request, std::string_view text) noexcept {
  body_->running.show_progress(request, text);
}
bool UntypedBackend::runs(std::uint32_t request) const noexcept {
  return body_->running.runs(request);
}
bool UntypedBackend::runs_any() const noexcept { return body_->running.any(); }

void UntypedBackend::interrupt(std::uint32_t actuator) noexcept { body_->interrupt(actuator); }

void UntypedBackend::ask_to_stop() noexcept {
  body_->stop.store(true, std::memory_order_relaxed);
  ring_bell(body_->segment.view());
}
bool UntypedBackend::stop_asked() const noexcept {
  return body_->stop.load(std::memory_order_relaxed);
}
std::string_view UntypedBackend::failure() const noexcept { return body_->failure.data(); }

void UntypedBackend::end(BackendState stopped_or_failed, std::string_view text) noexcept {
  body_->end(stopped_or_failed, text);
}

}  // namespace o80
