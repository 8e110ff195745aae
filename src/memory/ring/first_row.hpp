#pragma once

#include <span>

#include "memory/segment/attached_segment.hpp"
#include "memory/segment/signal.hpp"

namespace o80 {

/// A row of a segment that somebody waits for.
struct RowOf {
  const AttachedSegment* segment;
  Iteration row;
};

/// Waits until at least one of these rows is published: one sleep on all of their segments.
///
/// Looks every millisecond instead at segments that it may only read, at those beyond the first
/// kMaxFutexWords, and at all where the kernel cannot wait for several words.
/// Throws the BackendGone of the first segment that has ended without its row, and Cancelled.
Waited wait_for_first_row(std::span<const RowOf> rows, const Deadline& deadline,
                          const KeepWaiting& keep_waiting = {});

}  // namespace o80
