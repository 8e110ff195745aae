#pragma once

#include <span>
#include <string>
#include <vector>

#include "o80/describe/schema.hpp"
#include "o80/runtime/batch.hpp"
#include "runtime/frontend/sent_commands.hpp"

namespace o80 {

/// Names of the actuators of a command; empty for a request.
std::vector<std::string> names_of(const Schema& schema, std::span<const SentCommand> command);

/// What happened to one record: "'elbow' was purged in iteration 7 (its frontend died)".
std::string end_text(const Schema& schema, std::span<const SentCommand> command,
                     const Handle& handle);

/// Why a command takes longer than requested: "2 iterations later than requested, because of its
/// jerk limit". `packed` as in Limited::packed().
std::string late_text(std::uint8_t packed, std::int64_t late);

/// The text of NotCompleted, from those of `records` records that did not complete.
std::string not_completed_text(const std::string& segment, const std::vector<std::string>& ends,
                               std::size_t records);

}  // namespace o80
