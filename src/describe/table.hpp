#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "o80/describe/schema_bytes.hpp"

namespace o80 {

/// The schema of a segment; throws SegmentError for any invalid bytes.
Schema schema_from_bytes(std::span<const std::byte> bytes);

/// Throws InvalidArgument if a schema is inconsistent (for example two actuators of one name, a
/// field outside its struct, a minimum above its maximum).
void check(const Schema& schema);

/// Throws InvalidArgument if a simulation cannot take this schema as its Face.
void check_face(const Schema& face);

/// Hash of layout, names, limits and requests.
std::uint64_t hash(const Schema& schema);

/// The first five differences, a line each, in words, and how many more there are; empty if nothing
/// differs. A watchdog may be set otherwise, and the model that viewers draw may differ.
std::string difference(const Schema& expected, const Schema& found);

/// The differences that matter to a program compiled for `expected`: offsets and kinds of the
/// numbers in the actuators' states, the sensor values and the requests of `expected`.
std::string layout_difference(const Schema& expected, const Schema& found);

}  // namespace o80
