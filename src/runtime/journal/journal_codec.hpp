#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "runtime/journal/journal_author.hpp"

namespace o80 {

/// file => memory: calls take(entry) for each entry in `bytes`, as a ring would hold it; it may
/// move the entry. Throws InvalidArgument for another version of the format, and if the bytes are
/// damaged; the entries before were taken then.
void decode_journal(std::int64_t version, std::span<const std::byte> bytes,
                    const std::function<void(JournalItem&)>& take);

}  // namespace o80
