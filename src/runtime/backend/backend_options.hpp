#pragma once

#include <cstdint>

#include "memory/segment/owned_segment.hpp"
#include "o80/runtime/backend.hpp"

namespace o80 {

/// The schema with what the options say: period, clock, watchdog. Throws InvalidArgument.
Schema prepared(Schema schema, const BackendOptions& options);
/// How a backend is started: what the caller knows, the effective options, the versions, the clock.
Provenance provenance_of(const Schema& schema, const BackendOptions& options);
/// Creates the segment. Throws SegmentTaken, SegmentError.
OwnedSegment segment_of(const Schema& schema, const Provenance& provenance,
                        const BackendOptions& given);
/// The time between two rows that halts [ns]; 0: none does.
std::int64_t longest_gap(const Schema& schema, const BackendOptions& options);
/// The options of a backend as names and texts, each as its loop option of that name takes it
/// (robot/loop/loop_options.hpp). An option that is off and has no text for it is left out.
Provenance::Options texts_of(const BackendOptions& options);

}  // namespace o80
