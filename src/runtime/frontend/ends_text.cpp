#include "runtime/frontend/ends_text.hpp"

#include "base/sentence.hpp"
#include "o80/base/nearest_name.hpp"

namespace o80 {

namespace {

std::string request_name(const Schema& schema, std::uint16_t index) {
  return index < schema.requests.size() ? "'" + schema.requests[index].name.str() + "'" : "";
}

/// The subject of a sentence about a record, with its verb.
std::string subject_of(const Schema& schema, std::span<const SentCommand> command) {
  switch (command.empty() ? RecordKind::batch : command.front().kind) {
    case RecordKind::command: {
      std::vector<std::string> names = names_of(schema, command);
      for (std::string& name : names) name = "'" + name + "'";
      return first_names(names) + (names.size() == 1 ? " was " : " were ");
    }
    case RecordKind::request:
      return "request " + request_name(schema, command.front().index) + " was ";
    case RecordKind::purge:
      return "the purge was ";
    case RecordKind::take_control:
      return "the order to take control was ";
    case RecordKind::release_control:
      return "the order to release control was ";
    case RecordKind::mark:
      return "the mark was ";
    default:
      return "a record was ";
  }
}

std::string verb_of(const Handle& handle) {
  if (handle.status == Status::overwritten) return "overwritten by a command of another frontend";
  if (handle.status == Status::interrupted && handle.reason != Reason::limits) {
    return "interrupted by the driver";
  }
  return std::string(to_text(handle.status));
}

}  // namespace

std::vector<std::string> names_of(const Schema& schema, std::span<const SentCommand> command) {
  std::vector<std::string> names;
  for (const SentCommand& each : command) {
    if (each.kind != RecordKind::command || each.index >= schema.actuators.size()) continue;
    names.push_back(schema.actuators[each.index].name.str());
  }
  return names;
}

std::string end_text(const Schema& schema, std::span<const SentCommand> command,
                     const Handle& handle) {
  const std::string text = subject_of(schema, command) + verb_of(handle) + " in iteration " +
                           std::to_string(handle.iteration);
  return handle.text.empty() ? text : text + " (" + handle.text + ")";
}

std::string late_text(std::uint8_t packed, std::int64_t late) {
  constexpr const char* kLimits[] = {
      "a limit",       "its minimum", "its maximum", "its speed limit", "its acceleration limit",
      "its jerk limit"};
  const std::size_t limit = packed & 7U;
  const unsigned number = packed >> 3U;
  const std::string text = kLimits[limit < std::size(kLimits) ? limit : 0];
  return std::to_string(late) + (late == 1 ? " iteration" : " iterations") +
         " later than requested, because of " + text +
         (number == 0 ? "" : " (number " + std::to_string(number) + " of its state)");
}

std::string not_completed_text(const std::string& segment, const std::vector<std::string>& ends,
                               std::size_t records) {
  const std::string which =
      records == 1 ? "the command"
                   : std::to_string(ends.size()) + " of " + std::to_string(records) + " commands";
  const std::string text =
      which + " sent to '" + segment + "' did not complete: " + first_names(ends, "; ", "; and ");
  return sentence(text) +
         " See where the robot is (`observation` of this error) before you send more; if " +
         "such an end is expected, wait with check=False";
}

}  // namespace o80
