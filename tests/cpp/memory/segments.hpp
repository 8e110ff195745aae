#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "memory/private_directory.hpp"
#include "memory/segment/attached_segment.hpp"
#include "memory/segment/owned_segment.hpp"
#include "message_of.hpp"

namespace o80 {

inline SegmentSpec small_spec(const std::string& name = "arm") {
  return {.name = name, .schema = {}, .row_bytes = 64, .rows = 16, .lanes = 2, .lane_blocks = 16};
}

inline OwnedSegment running_segment(const SegmentSpec& spec = small_spec()) {
  OwnedSegment segment = OwnedSegment::create(spec);
  segment.set_state(BackendState::running);
  return segment;
}

inline Deadline soon() { return Deadline(std::chrono::milliseconds(5)); }
/// Long enough for any machine; no test waits for it to pass.
inline Deadline patient() { return Deadline(std::chrono::seconds(60)); }

inline AttachedSegment attach(const std::string& name = "arm", Access access = Access::read_write) {
  return AttachedSegment::attach(name, access, patient());
}

/// Also to the segment of one that has ended.
inline AttachedSegment attach_dead(Access access = Access::read_only) {
  return AttachedSegment::attach("arm", access, soon(), {.dead = true});
}

/// A test with its own directory of segments.
class SegmentTest : public ::testing::Test {
 protected:
  PrivateDirectory directory_;
};

}  // namespace o80
