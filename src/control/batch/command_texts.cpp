// The texts of the enumerations of commands, in the order of their enumerators.

#include <cstddef>

#include "o80/control/command.hpp"
#include "o80/control/status.hpp"

namespace o80 {

namespace {

template <class Enum, std::size_t count>
std::string_view text_of(Enum value, const std::string_view (&texts)[count]) noexcept {
  const auto index = static_cast<std::size_t>(value);
  return index < count ? texts[index] : "unknown";
}

}  // namespace

std::string_view to_text(Mode mode) noexcept { return text_of(mode, {"queue", "overwrite"}); }

std::string_view to_text(Pace pace) noexcept {
  return text_of(pace, {"direct", "duration", "speed", "until", "iterations", "fastest", "chunk"});
}

std::string_view to_text(Profile profile) noexcept {
  return text_of(profile, {"linear", "minimum_jerk", "as_sent", "monotone", "hold", "smooth"});
}

std::string_view to_text(Start start) noexcept { return text_of(start, {"desired", "observed"}); }

std::string_view to_text(Status status) noexcept {
  return text_of(status, {"none", "queued", "active", "completed", "overwritten", "purged",
                          "interrupted", "rejected", "forgotten", "halted"});
}

std::string_view to_text(Reason reason) noexcept {
  return text_of(reason,
                 {"none", "late", "exclusive", "invalid", "limits", "driver", "fresh_start",
                  "dead_frontend", "silence", "stopped", "halted", "full", "reading", "older"});
}

}  // namespace o80
