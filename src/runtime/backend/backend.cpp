#include "o80/runtime/backend.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

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

}  // namespace

UntypedBackend::Body::Body(Schema&& given, const BackendOptions& options, RequestServer* server,
                           RecordedDecisions* recorded)
    : schema(prepared(std::move(given), options)),
      layout(row_layout(schema)),
      provenance(provenance_of(schema, options)),
      segment(segment_of(schema, provenance, options)),
      history(segment.view()),
      journal(segment.view()),
      row_signal(segment.view()),
      bell(segment.view()),
      lanes(segment.view(), offsetof(BatchRecord, ticket)),
      liveness(segment),
      pool(lanes.size() * segment.view().shape.lane_blocks),
      controller(schema, pool, *this, lanes.size()),
      staging(lanes, pool, controller, journal),
      schedule(lanes.size()),
      halts(segment.view()),
      running(schema, segment.view()),
      verbs(segment.view()),
      server_(server),
      recorded_(recorded),
      lives_(lanes.size()),
      handled_deaths_(lanes.size()),
      row_(layout.size / 8),
      payload_(largest_request(schema), std::byte{0}),
      fresh_desired_(layout.block / 8),
      stale_(options.stale_policy()),
      silence_(options.silence),
      last_life_(lanes.size()),
      // ends of commands in one step: completed and late ones, and those of their batches
      outbox_(lanes, journal,
              2 * (schema.actuators.size() + 2 * Controller::kStatusesPerIteration)),
      queue_(segment.view()),
      errors_(schema),
      readings_(schema),
      followed_(schema, options.bursting || recorded != nullptr ? ReadingWatch::Of::none
                                                                : ReadingWatch::Of::followers),
      judges_first_(!options.bursting && recorded == nullptr && !options.accept_reading &&
                    !readings_.empty()),
      judges_fresh_(options.has_loop && recorded == nullptr &&
                    schema.head.of_the_world >= (options.bursting ? 3 : 1) &&
                    !schema.head.is_simulated()),
      last_row_(layout.size / 8),
      overruns_(options.max_overruns),
      gaps_(recorded == nullptr ? longest_gap(schema, options) : 0) {
  express_lanes_.reserve(lanes.size());
  for (std::uint32_t i = 0; i < lanes.size(); ++i) lives_[i] = liveness.lane(i);
}

// ------------------------------------------------------------------------------ state and time

/// True in a child that was forked since: the robot and the segment belong to its parent.
bool UntypedBackend::Body::is_in_forked_child() noexcept {
  if (!guard_.forked()) return false;
  note_failure("this process was forked: the backend belongs to its parent");
  return true;
}

std::int64_t UntypedBackend::Body::real_time() const noexcept {
  return recorded_ == nullptr ? monotonic_now() : recorded_->time(current);
}

// ------------------------------------------------------------------------------ step

/// Commands => desired, in four stages: watch, take, wait, move. A bursting backend waits at most
/// `at_most` [ns] for a burst.
Step UntypedBackend::Body::step(std::int64_t at_most) noexcept {
  if (recorded_ != nullptr) return step_recorded();
  if (burst_.is_direct()) return step_direct();
  const std::int64_t give_up =
      at_most > 0 && at_most < kForEver ? monotonic_now() + at_most : at_most;
  const bool waited = !is_granted();
  std::uint32_t scans = 0;
  while (true) {
    watch();
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    take_commands();
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    if (is_granted()) {
      // a pulse that came in this step is a sign of life; a halt may end the burst
      watch_silence();
      watch_halt();
      if (is_granted()) break;
    }
    if (!wait_for_burst(give_up, scans)) return Step::standing;
  }
  O80_CRASH_POINT("backend.after_take");
  if (burst_.runs()) begin_iteration_of_burst(waited);
  move(Phase::iterating);
  show_acts();
  O80_CRASH_POINT("backend.after_step");
  return Step::run;
}

/// Batches => queues, within the budget of an iteration; none during a burst.
void UntypedBackend::Body::take_commands() noexcept {
  share_ = {};
  if (burst_.runs()) return;
  take_due();
  take_batches();
}

/// Waits for the bell, until `give_up` [ns]; false if that is over. First reports all pending
/// statuses. `scans` counts scans of the lanes that found invalid blocks.
bool UntypedBackend::Body::wait_for_burst(std::int64_t give_up, std::uint32_t& scans) noexcept {
  const bool all_told = controller.finish_pending();
  journal.flush();
  wake_sleepers(segment.view(), {.lanes = lanes.announce()});
  if (staging.busy() || !all_told) return true;
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
  if (!burst_.runs()) return;  // its commands have ended
  share_ = {};
  take_due();
  if (burst_.is_in_last_iteration()) history.expect(current);
}

/// Queues => desired.
void UntypedBackend::Body::move(Phase under_way) noexcept {
  enter(under_way);
  outbox_.begin_step();
  controller.step(current, row() + layout.observed);
  outbox_.end_step();
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

// ------------------------------------------------------------------------------ publish

bool UntypedBackend::Body::publish_first() noexcept {
  if (!can_begin(row() + layout.observed, "the first reading")) return false;
  if (!agrees_with_first()) return false;
  if (!stop.load(std::memory_order_relaxed)) failure[0] = 0;  // that of a row 0 refused before
  publish(false);
  return true;
}

/// Reading, desired states => row. Then statuses, and whoever waits is woken. `fresh`: the row of a
/// fresh start, which comes within a step.
void UntypedBackend::Body::publish(bool fresh) noexcept {
  if (!has_begun()) {
    controller.restart(row() + layout.observed, begins_with, current);
    if (recorded_ == nullptr) {
      watch_halt();
    } else {
      obey_recorded();
    }
  }
  fill_row(fresh);
  history.publish(current, row());
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
  if (layout.mask_words == 1) {  // mostly: no calls
    std::memcpy(row() + layout.active, controller.active_mask(), 8);
    std::memcpy(row() + layout.clamped, controller.clamped_mask(), 8);
    std::memcpy(row() + layout.braking, controller.braking_mask(), 8);
    std::memcpy(row() + layout.starved, controller.starved_mask(), 8);
  } else if (layout.mask_words > 1) {
    std::memcpy(row() + layout.active, controller.active_mask(), layout.mask_words * 8);
    std::memcpy(row() + layout.clamped, controller.clamped_mask(), layout.mask_words * 8);
    std::memcpy(row() + layout.braking, controller.braking_mask(), layout.mask_words * 8);
    std::memcpy(row() + layout.starved, controller.starved_mask(), layout.mask_words * 8);
  }
}

/// Row => halts: error limits, readings, gaps.
void UntypedBackend::Body::watch_row(bool fresh) noexcept {
  // before a fresh start the robot may be away from its desired states
  if (!errors_.empty() && has_begun() && !fresh && !will_start_afresh()) watch_errors();
  watch_readings();
  if (!followed_.empty()) watch_followers(fresh);
  if (gaps_.is_on()) watch_gaps(fresh);
}

/// Reports the statuses that belong to the row, and counts the iteration of a burst.
void UntypedBackend::Body::end_iteration() noexcept {
  outbox_.report_row();
  controller.finish_pending();
  if (phase == Phase::iterating) {
    enter(Phase::ready);
  } else if (phase == Phase::braking) {
    enter(Phase::stopping);
  }
  count_burst();
  if (journal.lacks_rest() && is_at_rest()) journal.at_rest();
}

void UntypedBackend::Body::end(BackendState state, std::string_view text) noexcept {
  if (guard_.forked()) return;  // only the parent ends its backend
  if (phase == Phase::ended) return;
  enter(Phase::ended);
  // the current burst gets no last row: its waiter raises BackendGone
  burst_.end();
  reject_all(Reason::stopped);
  outbox_.report_no_row();
  controller.purge(kEveryActuator, current, Reason::stopped);
  drop_running({Status::purged, Reason::stopped});
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
    : body_(std::make_unique<Body>(std::move(schema), options, server, recorded)) {}

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
bool UntypedBackend::watches_readings() const noexcept { return body_->watches_readings(); }
bool UntypedBackend::judge_first(bool again) noexcept { return body_->judge_first(again); }
bool UntypedBackend::publish() noexcept {
  if (body_->is_in_forked_child()) return false;
  if (!body_->has_begun()) return body_->publish_first();
  if (!body_->agrees_with_first()) return false;
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
void UntypedBackend::cut_burst() noexcept { body_->stop_burst(); }
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
void UntypedBackend::set_timing(const Timing& timing) noexcept { body_->set_timing(timing); }
Step UntypedBackend::brake() noexcept {
  return body_->is_in_forked_child() ? Step::ended : body_->brake();
}
bool UntypedBackend::acts() const noexcept { return body_->acts(); }
void UntypedBackend::enter(Verb verb) noexcept { body_->verbs.enter(verb); }
void UntypedBackend::leave() noexcept { body_->verbs.leave(); }

void UntypedBackend::halt(HaltCause cause, std::string_view text) noexcept {
  body_->ask_to_halt(cause, text);
}
const Halt& UntypedBackend::halted() const noexcept { return body_->halts.halt(); }

void UntypedBackend::end_request(std::uint32_t request, const Served& how) noexcept {
  body_->end_request(request, how);
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
  body_->bell.interrupt();
}
bool UntypedBackend::stop_asked() const noexcept {
  return body_->stop.load(std::memory_order_relaxed);
}
std::string_view UntypedBackend::failure() const noexcept { return body_->failure.data(); }

void UntypedBackend::end(BackendState stopped_or_failed, std::string_view text) noexcept {
  body_->end(stopped_or_failed, text);
}

}  // namespace o80
