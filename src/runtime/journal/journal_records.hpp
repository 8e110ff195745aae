#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "o80/describe/schema.hpp"
#include "o80/runtime/journal.hpp"

namespace o80 {

/// The records of a batch, from its blocks as they came from a lane. A record that is invalid ends
/// the list: the backend has rejected it. One that this o80 does not know is listed as unknown.
std::vector<JournalRecord> records_of(const Schema& schema, std::span<const std::byte> blocks);

/// By which row the batch in these blocks was decided; empty if its sender does not say, or says
/// something that is no row.
std::optional<Seen> seen_in(std::span<const std::byte> blocks);

}  // namespace o80
