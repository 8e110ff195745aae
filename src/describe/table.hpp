#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "o80/describe/schema.hpp"

namespace o80 {

/// The schema as the bytes that stand in a segment.
std::vector<std::byte> to_bytes(const Schema& schema);

/// The schema of a segment; throws SegmentError if the bytes cannot be one, whatever they are.
Schema schema_from_bytes(std::span<const std::byte> bytes);

/// Throws InvalidArgument if a schema cannot be used: two actuators of one name, a field that lies
/// outside its struct, a limit whose minimum is above its maximum...
void check(const Schema& schema);

/// Tells schemas apart; those of equal hash have equal layout, names, limits and requests.
std::uint64_t hash(const Schema& schema);

/// What differs, a line each, in words; empty if nothing does. A watchdog may be set otherwise.
std::string difference(const Schema& expected, const Schema& found);

/// The same, but only of what a program that was compiled for `expected` relies on: the actuators'
/// states, the sensor values and the requests it knows, where their numbers lie and what they are.
std::string layout_difference(const Schema& expected, const Schema& found);

/// For people and foreign tools.
std::string to_json(const Schema& schema);

}  // namespace o80
