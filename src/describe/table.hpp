#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "o80/describe/schema.hpp"

namespace o80 {

/// The bytes of a schema, as stored in a segment.
std::vector<std::byte> to_bytes(const Schema& schema);

/// The schema of a segment; throws SegmentError for any invalid bytes.
Schema schema_from_bytes(std::span<const std::byte> bytes);

/// Throws InvalidArgument if a schema is inconsistent (for example two actuators of one name, a
/// field outside its struct, a minimum above its maximum).
void check(const Schema& schema);

/// Hash of layout, names, limits and requests.
std::uint64_t hash(const Schema& schema);

/// The first five differences, a line each, in words, and how many more there are; empty if nothing
/// differs. A watchdog may be set otherwise, and the model that viewers draw may differ.
std::string difference(const Schema& expected, const Schema& found);

/// The differences that matter to a program compiled for `expected`: offsets and kinds of the
/// numbers in the actuators' states, the sensor values and the requests of `expected`.
std::string layout_difference(const Schema& expected, const Schema& found);

}  // namespace o80
