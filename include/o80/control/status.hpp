#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace o80 {

/// Identifies a command, a request or a batch within its lane; from 1, never reused.
using CommandId = std::uint64_t;

/// Status of a command or a request. All values from `completed` on are end statuses; each command
/// gets exactly one of them.
enum class Status : std::uint8_t {
  none,
  queued,
  active,
  completed,
  overwritten,
  purged,
  interrupted,
  rejected,
  forgotten,  // the slot of the status was reused; set by a frontend only
  halted
};
inline constexpr std::size_t kStatuses = static_cast<std::size_t>(Status::halted) + 1;

/// Reason of a status.
enum class Reason : std::uint8_t {
  none,
  late,
  exclusive,  // the lane of the detail has exclusive control
  invalid,    // invalid data in the lane
  limits,
  driver,  // the driver rejected it, with a text
  fresh_start,
  dead_frontend,
  silence,
  stopped,
  halted,
  full,     // too many batches of the lane wait for a later iteration
  reading,  // the robot cannot have moved to the position of its reading
  older     // the chunk refers to an older observation than the previous one
};
inline constexpr std::size_t kReasons = static_cast<std::size_t>(Reason::older) + 1;

std::string_view to_text(Status status) noexcept;
std::string_view to_text(Reason reason) noexcept;

/// True for an end status: it does not change any more.
constexpr bool is_end(Status status) noexcept { return status >= Status::completed; }

}  // namespace o80
