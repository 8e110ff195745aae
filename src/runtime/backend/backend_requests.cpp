// How a backend serves requests, at once or over several iterations, resumes, and makes fresh
// starts.

#include "base/short_text.hpp"
#include "o80/describe/describe.hpp"
#include "runtime/backend/backend_body.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

void UntypedBackend::Body::interrupt(std::uint32_t actuator) noexcept {
  if (recorded != nullptr) {
    recorded->interrupt(current, static_cast<std::uint16_t>(actuator),
                        schema.actuators[actuator].name.view());
  }
  journal.interrupted(actuator, !is_under_way());
  controller.interrupt(actuator, current);
}

Outcome UntypedBackend::Body::request(std::uint32_t lane, CommandId id, BlockIndex record,
                                      std::uint32_t index, Cursor payload) noexcept {
  if (recorded != nullptr && !recorded->has_driver()) {
    return recorded->made_fresh_start(current, lane, id) ? start_afresh(lane, id) : Outcome{};
  }
  const std::size_t size = schema.types[schema.requests[index].type].size;
  payload.read(payload_.data(), size);
  if (server == nullptr) {
    return reject_request(lane, id,
                          "this backend serves no requests: it was made without a RequestServer");
  }
  ShortText<248> why;
  if (!running.may_begin(index, why)) return reject_request(lane, id, why.view());

  const Served served = asks("the handler of a request", [&](RequestServer& robot) {
    return robot.serve(index, {payload_.data(), size});
  });
  switch (served.kind) {
    case Served::Kind::done:
      if (journal.is_on()) {
        const KeptState kept = server->kept_state(index, {payload_.data(), size});
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
  if (readings.judges_fresh_starts() && has_begun()) {
    if (!halts.acts()) {
      readings.begin(reading.observed, unpack<RowHead>(row()).time);
    }
    ShortText<248> why;
    if (readings.read_again(reading, Readings::Judged::readings, why))
      return begin_afresh(lane, reading);
    halts.request(HaltCause::error, why.view());
    lanes[lane].set_message(id, why.view());
    return {Status::rejected, Reason::reading, 0};
  }
  bool reads = readings.reads_fresh(reading);
  if (!reads) note_failure("the robot could not be read in a fresh start");
  reads = reads && readings.can_begin(reading.observed, "the reading of a fresh start");
  if (reads && reading.has_desired) {
    reads = readings.can_begin(reading.desired, "the desired states of a fresh start");
  }
  if (!reads) {
    if (has_begun()) enter(Phase::unreadable);
    stop.store(true, std::memory_order_relaxed);
    return reject_request(lane, id, failure.data());
  }
  return begin_afresh(lane, reading);
}

Outcome UntypedBackend::Body::begin_afresh(std::uint32_t lane,
                                           const FreshReading& reading) noexcept {
  const std::byte* wanted = reading.has_desired ? reading.desired : nullptr;
  controller.restart(reading.observed, wanted, current, reading.follows);
  if (recorded != nullptr) recorded->fresh_start(current);
  journal.fresh_start(lane, reading.follows);
  readings.begin(reading.observed, time());
  publish(true);
  return {};
}

// ------------------------------------------------------------------------------ resume

Outcome UntypedBackend::Body::resume(std::uint32_t lane, CommandId id, std::uint64_t number,
                                     bool accepts) noexcept {
  if (!halts.acts()) return {};
  const auto refuse = [&](std::string_view why, Reason reason = Reason::halted) {
    lanes[lane].set_message(id, why);
    return Outcome{Status::rejected, reason, 0};
  };
  if (const auto why = halts.refusal(number); !why.view().empty()) return refuse(why.view());

  ShortText<248> unread;
  if (readings.name_not_finite(row() + layout.observed, "the last reading", unread)) {
    return refuse(unread.view(), Reason::driver);
  }
  accepts = accepts || recorded != nullptr;  // a replay obeys
  if (!accepts && readings.is_misread(row() + layout.observed, kToResume, unread)) {
    return refuse(unread.view(), Reason::reading);
  }

  // the robot may refuse; a halt requested meanwhile stays
  if (server != nullptr) {
    Served served = asks("the handler of a resume", &RequestServer::resume);
    if (served.kind == Served::Kind::running) {
      served = Served::rejected("the robot is not ready: resume it again when it is");
    }
    if (served.kind == Served::Kind::failed) fail(served.why());
    if (served.kind == Served::Kind::failed || served.kind == Served::Kind::rejected) {
      return refuse(served.why(), Reason::driver);
    }
  }
  if (!halts.clear()) {
    return refuse("another halt was requested meanwhile: read its reason, then resume that one");
  }
  journal.resume(lane, intake.owner(), number);
  if (recorded != nullptr && !recorded->begins_with_fresh_start(current)) {
    return refuse("the reading was refused in the recorded run", Reason::reading);
  }
  FreshReading reading{row() + layout.observed, row() + layout.extended,
                       reinterpret_cast<std::byte*>(fresh_desired_.data())};
  if (server != nullptr &&
      !readings.read_again(reading, accepts ? Readings::Judged::none : Readings::Judged::all,
                           unread)) {
    halts.request(HaltCause::error, unread.view());
    return refuse(unread.view(), Reason::reading);
  }
  return begin_afresh(lane, reading);
}

// ------------------------------------------------------------------------------ running

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

}  // namespace o80
