// How a backend serves requests, at once or over several iterations, and makes fresh starts.

#include <cstring>

#include "describe/number_name.hpp"
#include "o80/describe/describe.hpp"
#include "runtime/backend/backend_body.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

namespace {
// a robot that moves at its highest speed may be read to be faster, because of noise
constexpr double kInMotion = 2.0;
constexpr std::string_view kToFollow =
    "halt the robot and resume with --accept-reading (accept_reading in code)";
}  // namespace

void UntypedBackend::Body::interrupt(std::uint32_t actuator) noexcept {
  if (recorded_ != nullptr) {
    recorded_->interrupt(current, static_cast<std::uint16_t>(actuator),
                         schema.actuators[actuator].name.view());
  }
  journal.interrupted(actuator, !is_under_way());
  controller.interrupt(actuator, current);
}

Outcome UntypedBackend::Body::request(std::uint32_t lane, CommandId id, BlockIndex record,
                                      std::uint32_t index, Cursor payload) noexcept {
  if (recorded_ != nullptr && !recorded_->has_driver()) {
    return recorded_->made_fresh_start(current, lane, id) ? start_afresh(lane, id) : Outcome{};
  }
  const std::size_t size = schema.types[schema.requests[index].type].size;
  payload.read(payload_.data(), size);
  if (server_ == nullptr) {
    return reject_request(lane, id,
                          "this backend serves no requests: it was made without a RequestServer");
  }
  ShortText<248> why;
  if (!running.may_begin(index, why)) return reject_request(lane, id, why.view());

  const Served served = asks("the handler of a request", [&](RequestServer& server) {
    return server.serve(index, {payload_.data(), size});
  });
  switch (served.kind) {
    case Served::Kind::done:
      if (journal.is_on()) {
        const KeptState kept = server_->kept_state(index, {payload_.data(), size});
        if (!kept.bytes.empty()) journal.kept(kept);
      }
      return {};
    case Served::Kind::rejected:
      return reject_request(lane, id, served.why());
    case Served::Kind::start_afresh:
      return start_afresh(lane, id);
    case Served::Kind::running:
      running.begin(index, lane, id, record, current, served.why());
      return {.status = Status::active};
    case Served::Kind::failed:
      break;
  }
  fail(served.why());
  return reject_request(lane, id, served.why());
}

Outcome UntypedBackend::Body::reject_request(std::uint32_t lane, CommandId id,
                                             std::string_view why) noexcept {
  lanes[lane].set_message(id, why);
  return {Status::rejected, Reason::driver, 0};
}

/// Makes a fresh start: reads the robot again and publishes the reading as a row of its own.
Outcome UntypedBackend::Body::start_afresh(std::uint32_t lane, CommandId id) noexcept {
  auto* desired = reinterpret_cast<std::byte*>(fresh_desired_.data());
  FreshReading reading{row() + layout.observed, row() + layout.extended, desired};
  // a simulation may be put anywhere, a robot of the world cannot
  if (judges_fresh_ && has_begun()) {
    if (!halts.acts()) {
      readings_.begin(reading.observed);
      read_at_ = unpack<RowHead>(row()).time;
    }
    ShortText<248> why;
    if (read_again(reading, Judged::readings, why)) return begin_afresh(lane, reading);
    ask_to_halt(HaltCause::error, why.view());
    lanes[lane].set_message(id, why.view());
    return {Status::rejected, Reason::reading, 0};
  }
  bool reads = reads_fresh(reading);
  if (!reads) note_failure("the robot could not be read in a fresh start");
  reads = reads && can_begin(reading.observed, "the reading of a fresh start");
  if (reads && reading.has_desired) {
    reads = can_begin(reading.desired, "the desired states of a fresh start");
  }
  if (!reads) {
    if (has_begun()) enter(Phase::unreadable);
    stop.store(true, std::memory_order_relaxed);
    return reject_request(lane, id, failure.data());
  }
  return begin_afresh(lane, reading);
}

/// Reads the robot for a fresh start; false if it cannot begin there, and the last reading stays.
bool UntypedBackend::Body::read_again(FreshReading& reading, Judged judged,
                                      ShortText<248>& why) noexcept {
  keep_reading();
  reading.may_fail = true;
  if (!reads_fresh(reading)) {
    why.add(reading.why.empty() ? "the robot could not be read" : reading.why);
  } else if (!name_not_finite(reading.observed, "the reading of a fresh start", why) &&
             (!reading.has_desired ||
              !name_not_finite(reading.desired, "the desired states of a fresh start", why))) {
    // a homing that gives desired states may move the zero of a sensor
    const bool is_judged =
        judged == Judged::all || (judged == Judged::readings && !reading.has_desired);
    if (!is_judged || !is_misread(reading.observed, kToResume, why)) return true;
  }
  put_back_reading();
  return false;
}

Outcome UntypedBackend::Body::begin_afresh(std::uint32_t lane,
                                           const FreshReading& reading) noexcept {
  const std::byte* wanted = reading.has_desired ? reading.desired : nullptr;
  controller.restart(reading.observed, wanted, current, reading.follows);
  if (recorded_ != nullptr) recorded_->fresh_start(current);
  journal.fresh_start(lane, reading.follows);
  readings_.begin(reading.observed);
  read_at_ = time();
  publish(true);
  return {};
}

// ------------------------------------------------------------------------------ readings

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

void UntypedBackend::Body::keep_reading() noexcept {
  if (layout.block > 0) std::memcpy(last_row_.data(), row() + layout.observed, layout.block);
}

void UntypedBackend::Body::put_back_reading() noexcept {
  if (layout.block > 0) std::memcpy(row() + layout.observed, last_row_.data(), layout.block);
}

/// The last reading before a halt may be the wrong one that has caused it: begins with the one
/// before, unless a fresh start lies between them.
void UntypedBackend::Body::begin_to_watch() noexcept {
  auto* before = reinterpret_cast<std::byte*>(last_row_.data());
  const bool has_before = has_begun() && current > 1 && unpack<RowHead>(row()).fresh == 0 &&
                          HistoryReader(segment.view()).read(current - 2, before);
  readings_.begin((has_before ? before : row()) + layout.observed);
  read_at_ = time();
  if (has_before) readings_.add(row() + layout.observed, kInMotion * since_reading());
}

/// While the robot is halted: notes each reading, for the resume.
void UntypedBackend::Body::watch_readings() noexcept {
  if (!halts.acts() || readings_.empty() || timing.missed) return;
  const double share = controller.braking() ? kInMotion : 1.0;
  readings_.add(row() + layout.observed, share * since_reading());
  read_at_ = time();
}

/// Notes each reading of actuators that follow, for the next command.
void UntypedBackend::Body::watch_followers(bool fresh) noexcept {
  if (timing.missed && has_begun() && !fresh) return;
  const std::int64_t since = time() - std::exchange(followed_at_, time());
  if (!has_begun() || fresh) return followed_.begin(row() + layout.observed);
  const std::int64_t elapsed = std::max(since, schema.head.period);
  followed_.add(row() + layout.observed, kInMotion * static_cast<double>(elapsed) * 1e-9);
}

/// True if actuators without a command that follow can be where they are read; else rejects what
/// moves.
bool UntypedBackend::Body::admitted_by_followers(const StagedBatch& sent) noexcept {
  if (followed_.empty() || !controller.effort(sent.batch).moves) return true;
  const auto fault = followed_.find_idle(controller.active_mask(), controller.braking_mask());
  if (!fault) return true;
  ShortText<248> why;
  describe_reading(schema, *fault, kToFollow, why);
  lanes[sent.lane].set_message(pool.batch(sent.batch).id, why.view());
  return reject(sent, Reason::reading);
}

/// Judges the reading of a member of a group that has followed while it waited, when the group
/// begins. A replay obeys the recorded decision.
bool UntypedBackend::Body::may_begin(std::uint32_t actuator, std::uint32_t lane,
                                     CommandId id) noexcept {
  if (recorded_ != nullptr) {
    if (recorded_->interrupt_due(current, true) != actuator) return true;
    recorded_->interrupt(current, static_cast<std::uint16_t>(actuator), {});
  } else {
    const auto fault = followed_.find_of(actuator);
    if (!fault) return true;
    ShortText<248> why;
    describe_reading(schema, *fault, kToFollow, why);
    lanes[lane].set_message(id, why.view());
  }
  journal.interrupted(actuator, true);
  return false;
}

/// The time since the last reading, at least a period: a backend may run ahead of its clock [s].
double UntypedBackend::Body::since_reading() const noexcept {
  return static_cast<double>(std::max(time() - read_at_, schema.head.period)) * 1e-9;
}

/// True if the robot cannot be where it was read; `why` says so.
bool UntypedBackend::Body::is_misread(const std::byte* observed, std::string_view cure,
                                      ShortText<248>& why) const noexcept {
  const auto fault = readings_.find(observed, since_reading());
  if (fault) describe_reading(schema, *fault, cure, why);
  return fault.has_value();
}

bool UntypedBackend::Body::judge_first(bool again) noexcept {
  judges_first_ = false;
  const std::byte* observed = row() + layout.observed;
  ShortText<248> why;
  const bool is_good =
      !again || !is_misread(observed, "start with --accept-reading (accept_reading in code)", why);
  if (!is_good) note_failure(why.view());
  readings_.begin(observed);
  read_at_ = time();
  return is_good;
}

/// Judges the first two readings of an embedded backend: row 0 by its bounds, the next by how far
/// the robot can have come. If the second is wrong, the backend ends.
bool UntypedBackend::Body::judge_against_first() noexcept {
  if (has_begun() && timing.missed) return true;
  if (has_begun()) {
    judges_first_ = false;
  } else {
    readings_.begin(row() + layout.observed);
    read_at_ = time();
  }
  ShortText<248> why;
  if (!is_misread(row() + layout.observed, "begin with accept_reading", why)) return true;
  note_failure(why.view());
  if (has_begun()) stop.store(true, std::memory_order_relaxed);
  return false;
}

// ------------------------------------------------------------------------------ running

void UntypedBackend::Body::end_running(RunningRequests::Entry& entry,
                                       const Outcome& outcome) noexcept {
  const BlockIndex record = entry.record;
  running.forget(entry);
  controller.end(record, outcome, current);
}

/// Reports requests that the driver has ended, after the row with their end is published. A request
/// that needs a fresh start is reported with the row of that.
void UntypedBackend::Body::report_ended_requests(bool fresh) noexcept {
  running.each([&](RunningRequests::Entry& entry) {
    if (!entry.end) return;
    const Served how = *entry.end;
    const RunningRequest& sent = entry.shown;
    switch (how.kind) {
      case Served::Kind::start_afresh:
        if (fresh) end_running(entry, {});
        return;
      case Served::Kind::rejected:
        return end_running(entry, reject_request(sent.lane, sent.id, how.why()));
      case Served::Kind::failed:
        fail(how.why());
        return end_running(entry, reject_request(sent.lane, sent.id, how.why()));
      default:
        return end_running(entry, {});
    }
  });
}

/// Makes the fresh start that an ended request needs, before any batch is taken.
void UntypedBackend::Body::start_afresh_after_request() noexcept {
  const RunningRequests::Entry* entry = running.wanting_fresh_start();
  if (entry == nullptr) return;
  const Outcome outcome = start_afresh(entry->shown.lane, entry->shown.id);
  if (outcome.status == Status::completed) return;  // reported with the fresh row
  running.each([&](RunningRequests::Entry& each) {
    if (&each == entry) end_running(each, outcome);
  });
}

/// Ends running requests without the driver. At a halt, requests that are served during halts
/// continue.
void UntypedBackend::Body::drop_running(const Outcome& outcome) noexcept {
  const bool is_halt = outcome.status == Status::halted;
  running.each([&](RunningRequests::Entry& entry) {
    if (!is_halt || !running.is_while_halted(entry)) end_running(entry, outcome);
  });
}

void UntypedBackend::Body::end_request(std::uint32_t request, const Served& how) noexcept {
  if (how.kind == Served::Kind::running) return running.show_progress(request, how.why());
  running.note_end(request, how);
}

}  // namespace o80
