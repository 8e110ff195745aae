#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace o80 {

/// Names a command, a request or a batch within its lane: from 1, never used twice.
using CommandId = std::uint64_t;

/// The progress of a command or a request; every one ends with one of those from `completed` on.
enum class Status : std::uint8_t {
  none,
  queued,
  active,
  completed,
  limited,  // completed, but clamped at its last iteration
  overwritten,
  purged,
  interrupted,
  rejected,
  forgotten,  // asked too late: only a frontend says so
  halted
};
inline constexpr std::size_t kStatuses = static_cast<std::size_t>(Status::halted) + 1;

/// Why a status is what it is.
enum class Reason : std::uint8_t {
  none,
  late,
  exclusive,  // another lane has control, detail says which
  invalid,    // garbage in the lane
  limits,
  driver,  // the text is the driver's
  fresh_start,
  dead_frontend,
  silence,
  stopped,
  halted,
  full  // more of its kind wait already than one lane may have
};
inline constexpr std::size_t kReasons = static_cast<std::size_t>(Reason::full) + 1;

std::string_view to_text(Status status) noexcept;
std::string_view to_text(Reason reason) noexcept;

/// Whether a command with this status changes no more.
constexpr bool is_end(Status status) noexcept { return status >= Status::completed; }

}  // namespace o80
