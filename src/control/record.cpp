#include "control/record.hpp"

namespace o80 {

std::string_view to_text(RecordKind kind) noexcept {
  switch (kind) {
    case RecordKind::batch:
      return "batch";
    case RecordKind::command:
      return "command";
    case RecordKind::purge:
      return "purge";
    case RecordKind::request:
      return "request";
    case RecordKind::group:
      return "group";
    case RecordKind::member:
      return "member";
    case RecordKind::take_control:
      return "take_control";
    case RecordKind::release_control:
      return "release_control";
    case RecordKind::resume:
      return "resume";
    default:
      return "unknown";
  }
}

std::string_view to_text(Mode mode) noexcept {
  return mode == Mode::queue ? "queue" : mode == Mode::overwrite ? "overwrite" : "unknown";
}

std::string_view to_text(Pace pace) noexcept {
  switch (pace) {
    case Pace::direct:
      return "direct";
    case Pace::duration:
      return "duration";
    case Pace::speed:
      return "speed";
    case Pace::until:
      return "until";
    case Pace::iterations:
      return "iterations";
    case Pace::fastest:
      return "fastest";
  }
  return "unknown";
}

std::string_view to_text(Profile profile) noexcept {
  return profile == Profile::linear         ? "linear"
         : profile == Profile::minimum_jerk ? "minimum_jerk"
                                            : "unknown";
}

std::string_view to_text(Start start) noexcept {
  return start == Start::desired ? "desired" : start == Start::observed ? "observed" : "unknown";
}

std::string_view to_text(Status status) noexcept {
  switch (status) {
    case Status::none:
      return "none";
    case Status::queued:
      return "queued";
    case Status::active:
      return "active";
    case Status::completed:
      return "completed";
    case Status::limited:
      return "limited";
    case Status::overwritten:
      return "overwritten";
    case Status::purged:
      return "purged";
    case Status::interrupted:
      return "interrupted";
    case Status::rejected:
      return "rejected";
    case Status::forgotten:
      return "forgotten";
    case Status::halted:
      return "halted";
  }
  return "unknown";
}

std::string_view to_text(Reason reason) noexcept {
  switch (reason) {
    case Reason::none:
      return "none";
    case Reason::late:
      return "late";
    case Reason::exclusive:
      return "exclusive";
    case Reason::invalid:
      return "invalid";
    case Reason::limits:
      return "limits";
    case Reason::driver:
      return "driver";
    case Reason::fresh_start:
      return "fresh_start";
    case Reason::dead_frontend:
      return "dead_frontend";
    case Reason::silence:
      return "silence";
    case Reason::stopped:
      return "stopped";
    case Reason::halted:
      return "halted";
    case Reason::full:
      return "full";
  }
  return "unknown";
}

}  // namespace o80
