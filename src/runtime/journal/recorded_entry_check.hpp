#pragma once

#include <cstdint>

#include "o80/describe/schema.hpp"
#include "o80/runtime/backend.hpp"
#include "o80/runtime/journal.hpp"

namespace o80 {

/// Throws InvalidArgument for an entry of a recorded journal that no backend of this robot, with so
/// many lanes, writes: the recording may be damaged, or from a stranger.
void check_recorded(const JournalEntry& entry, const Schema& schema, std::uint32_t lanes);

/// The options of the recorded run, for a backend that nobody halts or reads the journal of.
BackendOptions replaying(BackendOptions options);

}  // namespace o80
