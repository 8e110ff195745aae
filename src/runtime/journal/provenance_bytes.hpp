#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "o80/runtime/provenance.hpp"

namespace o80 {

/// The bytes of a provenance, as they stand in a segment.
std::vector<std::byte> to_bytes(const Provenance& provenance);

/// The provenance in these bytes. Throws SegmentError if they are damaged.
Provenance provenance_from_bytes(std::span<const std::byte> bytes);

}  // namespace o80
