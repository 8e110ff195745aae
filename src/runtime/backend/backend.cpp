#include "o80/runtime/backend.hpp"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <sstream>
#include <string>

#include "base/crash_point.hpp"
#include "control/number_plan.hpp"
#include "describe/number_name.hpp"
#include "describe/table.hpp"
#include "o80/base/version.hpp"
#include "runtime/backend/backend_body.hpp"
#include "runtime/backend/run_option_texts.hpp"
#include "runtime/journal/provenance_bytes.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

namespace {

constexpr std::uint64_t kDefaultHistoryBytes = 16U << 20;
constexpr std::uint64_t kDefaultHistoryRows = 100'000;
constexpr std::int64_t kDefaultPeriod = 1'000'000;  // [ns]
constexpr std::int64_t kPeriodRounding = 100'000;
/// Least journal of a backend [bytes]: a quarter holds the blocks that one iteration copies.
constexpr std::uint64_t kLeastBackendJournal = 8 * kWorkPerIteration * kBlockBytes;
constexpr std::int64_t kForEver = std::numeric_limits<std::int64_t>::max();

std::string rate_text(std::int64_t period) {
  std::ostringstream text;
  text << 1e9 / static_cast<double>(period) << " Hz (" << static_cast<double>(period) * 1e-6
       << " ms)";
  return text.str();
}

/// The requested period, the robot's own, or 1 ms.
std::int64_t period_of(const Schema& schema, const BackendOptions& options) {
  const std::int64_t own = schema.head.period;
  if (options.period < 0) {
    throw InvalidArgument("the period must be positive, got " + std::to_string(options.period) +
                          " ns");
  }
  // printed frequencies are rounded: 166.667 Hz means 6 ms
  const bool same = std::abs(options.period - own) * kPeriodRounding <= own;
  if (options.period > 0 && own > 0 && !same) {
    throw InvalidArgument("robot '" + std::string(schema.head.robot.view()) + "' runs at " +
                          rate_text(own) + ", not at " + rate_text(options.period) +
                          ": leave the frequency out, or ask for its own");
  }
  if (own > 0) return own;
  return options.period > 0 ? options.period : kDefaultPeriod;
}

Schema prepared(Schema schema, const BackendOptions& options) {
  if (options.silence > 0 && options.stale == Stale::hold) {
    throw InvalidArgument(
        "the watchdog (silence) needs a policy: set stale to purge, halt or stop, not to hold");
  }
  if (options.silence < 0) {
    throw InvalidArgument("silence must be 0 (no watchdog) or a number of iterations, got " +
                          std::to_string(options.silence));
  }
  if (options.permission < 0400 || options.permission > 0777) {
    std::ostringstream why;
    why << "permission must be an octal mode such as 0600, 0640 or 0660, got " << options.permission
        << " (octal " << std::oct << options.permission << ")";
    throw InvalidArgument(why.str());
  }
  schema.head.period = period_of(schema, options);
  schema.head.bursting = options.bursting ? 1 : 0;
  schema.head.clock = options.bursting ? Clock::simulated : Clock::monotonic;
  schema.head.stale = options.stale_policy();
  schema.head.silence = options.silence;
  schema.head.block = round_up(schema.head.block, 8);
  check(schema);
  return schema;
}

std::uint64_t rows_of(const BackendOptions& options, std::uint32_t row_bytes) {
  if (options.history > 0) return options.history;
  return std::clamp<std::uint64_t>(kDefaultHistoryBytes / row_bytes, 16, kDefaultHistoryRows);
}

/// Size of the journal: twice the largest batch, unless the options say otherwise.
std::uint64_t journal_bytes_of(const BackendOptions& options) {
  if (options.journal == 0) return 0;
  if (options.journal < 0) {
    const std::uint64_t lane = std::uint64_t{std::bit_ceil(options.lane_blocks)} * kBlockBytes;
    return std::max(2 * lane, kLeastBackendJournal);
  }
  return std::bit_ceil(std::max(static_cast<std::uint64_t>(options.journal), kLeastBackendJournal));
}

/// The options with the values that take the place of the defaults.
BackendOptions effective(const Schema& schema, const BackendOptions& options) {
  BackendOptions effective = options;
  effective.period = schema.head.period;
  effective.history = rows_of(options, row_layout(schema).size);
  effective.lane_blocks = std::bit_ceil(options.lane_blocks);
  effective.journal = static_cast<std::int64_t>(journal_bytes_of(options));
  return effective;
}

/// Wall-clock time of the moment at which the clock of the rows is 0 [ns].
std::int64_t wall_clock_offset(const Schema& schema) {
  if (schema.head.clock == Clock::simulated) return wall_clock_now();
  // of several readings the one with the shortest time in between
  std::int64_t offset = 0;
  std::int64_t shortest = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < 5; ++i) {
    const std::int64_t before = monotonic_now();
    const std::int64_t wall = wall_clock_now();
    const std::int64_t took = monotonic_now() - before;
    if (took >= shortest) continue;
    shortest = took;
    offset = wall - before - took / 2;
  }
  return offset;
}

Provenance provenance_of(const Schema& schema, const BackendOptions& options) {
  Provenance provenance = options.provenance;
  if (provenance.robot.empty()) provenance.robot = schema.head.robot.str();
  for (auto& option : texts_of(effective(schema, options)))
    provenance.run_options.push_back(std::move(option));
  provenance.version = version();
  provenance.source_hash = source_hash();
  provenance.motion_rules = kMotionRules;
  provenance.wall_clock_offset = wall_clock_offset(schema);
  return provenance;
}

OwnedSegment segment_of(const Schema& schema, const Provenance& provenance,
                        const BackendOptions& given) {
  const BackendOptions options = effective(schema, given);
  const std::vector<std::byte> bytes = to_bytes(schema);
  const std::vector<std::byte> provenance_bytes = to_bytes(provenance);
  SegmentSpec spec;
  spec.name = options.segment;
  spec.schema = bytes;
  spec.provenance = provenance_bytes;
  spec.row_bytes = row_layout(schema).size;
  spec.rows = options.history;
  spec.lanes = options.lanes;
  spec.lane_blocks = options.lane_blocks;
  spec.journal_bytes = static_cast<std::uint64_t>(options.journal);
  spec.permission = options.permission;
  spec.inherits_halt = !options.bursting && !options.resume;
  spec.anonymous = options.anonymous;
  return OwnedSegment::create(spec);
}

/// The time between two rows that halts [ns]; 0: none does.
std::int64_t longest_gap(const Schema& schema, const BackendOptions& options) {
  constexpr std::int64_t kPeriods = 20;
  constexpr std::int64_t kLeast = 100'000'000;
  if (options.bursting) return 0;
  if (options.gap >= 0) return options.gap;
  const bool moves = schema.head.of_the_world != 0 && !schema.actuators.empty();
  const std::int64_t least = moves ? std::max(kPeriods * schema.head.period, kLeast) : 0;
  const std::int64_t own = schema.head.gap * std::int64_t{1000};
  return own > 0 && (least == 0 || own < least) ? own : least;
}

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
      last_row_(layout.size / 8),
      overruns_(options.max_overruns),
      gaps_(recorded == nullptr ? longest_gap(schema, options) : 0) {
  express_lanes_.reserve(lanes.size());
  for (std::uint32_t i = 0; i < lanes.size(); ++i) lives_[i] = liveness.lane(i);
}

// ------------------------------------------------------------------------------ step, publish

/// In bursting mode waits at most `at_most` [ns] for a burst.
Step UntypedBackend::Body::step(std::int64_t at_most) noexcept {
  if (recorded_ != nullptr) return step_recorded();
  if (burst_.is_direct()) return step_direct();
  const std::int64_t give_up =
      at_most > 0 && at_most < kForEver ? monotonic_now() + at_most : at_most;
  const std::uint32_t most_looks = 2 + pool.size() / kWorkPerIteration;
  std::uint32_t looks = 0;
  const bool stands = schema.head.bursting != 0 && !burst_.runs();
  while (true) {
    look_at_lives();
    watch_halt();
    start_afresh_after_request();
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    share_ = {};
    if (!burst_.runs()) {
      take_due();
      take_batches();
    }
    if (stop.load(std::memory_order_relaxed)) return Step::ended;
    if (schema.head.bursting == 0 || burst_.runs()) {
      // a pulse that came in this step is a sign of life; a halt may end the burst
      watch_silence();
      watch_halt();
      if (schema.head.bursting == 0 || burst_.runs()) break;
    }
    // before waiting, report all pending statuses
    const bool all_told = controller.finish_pending();
    journal.flush();
    wake_sleepers(segment.view(), {.lanes = lanes.announce()});
    if (staging.busy() || !all_told) continue;
    // invalid blocks may have used up the budget of this scan: scan again, a limited number of
    // times
    if (lanes.has_pending() && ++looks < most_looks) continue;
    const std::int64_t left =
        give_up > 0 && give_up < kForEver ? give_up - monotonic_now() : give_up;
    if (left <= 0) return Step::standing;
    bell.wait(lanes.bell_seen(), std::min(left, kSlice));
  }
  O80_CRASH_POINT("backend.after_take");
  // A group command waits until its dropped members are reported. Report all of them first, so that
  // a burst does not depend on how long the backend has waited before.
  while (stands && !controller.finish_pending()) {
  }
  if (burst_.runs()) {
    share_ = {};
    take_due();
  }
  if (burst_.is_in_last_iteration()) history.expect(current);
  move();
  show_acts();
  O80_CRASH_POINT("backend.after_step");
  return Step::run;
}

/// Commands => desired.
void UntypedBackend::Body::move() noexcept {
  under_way_ = true;
  outbox_.begin_step();
  controller.step(current, row() + layout.observed);
  outbox_.end_step();
}

std::int64_t UntypedBackend::Body::real_time() const noexcept {
  return recorded_ == nullptr ? monotonic_now() : recorded_->time(current);
}

/// Finds NaN or infinity in the first reading or in a fresh start, which are refused because no
/// command could start from there. True if there is one; `why` names the first.
bool UntypedBackend::Body::name_not_finite(const std::byte* states, std::string_view what,
                                           ShortText<248>& why) const noexcept {
  const std::optional<NotFinite> found = controller.not_finite(states);
  if (!found) return false;
  name_number(schema, found->actuator, found->number, why);
  why.add(" is NaN or infinite in ").add(what);
  return true;
}

bool UntypedBackend::Body::can_begin(const std::byte* states, std::string_view what) noexcept {
  ShortText<248> why;
  if (name_not_finite(states, what, why)) note_failure(why.view());
  return why.view().empty();
}

/// True in a child that was forked since: the robot and the segment belong to its parent.
bool UntypedBackend::Body::is_in_forked_child() noexcept {
  if (!guard_.forked()) return false;
  note_failure("this process was forked: the backend belongs to its parent");
  return true;
}

bool UntypedBackend::Body::publish_first() noexcept {
  if (!can_begin(row() + layout.observed, "the first reading")) return false;
  if (!agrees_with_first()) return false;
  if (!stop.load(std::memory_order_relaxed)) failure[0] = 0;  // that of a row 0 refused before
  publish(false);
  return true;
}

void UntypedBackend::Body::publish(bool fresh) noexcept {
  if (!begun_) {
    controller.restart(row() + layout.observed, begins_with, current);
    if (recorded_ == nullptr) {
      watch_halt();
    } else {
      obey_recorded();
    }
  }

  // observed and extended are in the row already: add head, desired and masks
  RowHead head;
  head.iteration = current;
  head.time = time();
  head.lateness = timing.lateness;
  head.overruns = timing.overruns;
  head.skipped = timing.skipped;
  head.fresh = fresh ? 1 : 0;
  head.halted = halts.acts() ? 1 : 0;
  std::memcpy(row(), &head, sizeof head);
  if (layout.block > 0) std::memcpy(row() + layout.desired, controller.desired(), layout.block);
  if (layout.mask_words == 1) {  // mostly: no calls
    std::memcpy(row() + layout.active, controller.active_mask(), 8);
    std::memcpy(row() + layout.clamped, controller.clamped_mask(), 8);
    std::memcpy(row() + layout.braking, controller.braking_mask(), 8);
  } else if (layout.mask_words > 1) {
    std::memcpy(row() + layout.active, controller.active_mask(), layout.mask_words * 8);
    std::memcpy(row() + layout.clamped, controller.clamped_mask(), layout.mask_words * 8);
    std::memcpy(row() + layout.braking, controller.braking_mask(), layout.mask_words * 8);
  }
  history.publish(current, row());
  // before a fresh start the robot may be away from its desired states
  if (!errors_.empty() && begun_ && !fresh && !will_start_afresh()) watch_errors();
  watch_readings();
  if (!followed_.empty()) watch_followers(fresh);
  if (gaps_.is_on()) watch_gaps(fresh);
  tell_ended_requests(fresh);

  // report statuses, then wake waiting processes
  if (!fresh) {
    outbox_.report_row();
    controller.finish_pending();
    under_way_ = false;
    count_burst();
    if (journal.lacks_rest() && is_at_rest()) journal.at_rest();
  }
  journal.flush();
  wake_sleepers(segment.view(),
                {.lanes = !fresh && lanes.announce(), .rows = row_signal.announce(current)});
  if (!begun_) segment.set_state(BackendState::running);
  begun_ = true;
  journal.set_iteration(++current);
}

void UntypedBackend::Body::end(BackendState state, std::string_view text) noexcept {
  if (guard_.forked()) return;  // only the parent ends its backend
  if (segment.state() != BackendState::starting && segment.state() != BackendState::running) return;
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
bool UntypedBackend::unreadable() const noexcept { return body_->unreadable; }

void UntypedBackend::end(BackendState stopped_or_failed, std::string_view text) noexcept {
  body_->end(stopped_or_failed, text);
}

}  // namespace o80
