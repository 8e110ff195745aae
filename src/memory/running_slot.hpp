#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "memory/segment_layout.hpp"
#include "o80/base/time.hpp"

// The requests that a driver serves over several iterations, as everybody who may read the segment
// sees them.

namespace o80 {

/// A request that has begun and not ended.
struct RunningRequest {
  std::uint32_t request = 0;  // its place in the schema
  std::uint32_t lane = 0;
  std::uint64_t id = 0;              // within its lane
  Iteration since = -1;              // iteration in which it was taken
  std::array<char, 64> who{};        // the process that sent it
  std::array<char, 248> progress{};  // what the driver says of it

  std::string_view who_text() const noexcept { return who.data(); }
  std::string_view progress_text() const noexcept { return progress.data(); }
};

/// Shows a request that runs, or its new progress. `number` is above 0 and differs from that of
/// every earlier write: a reader that finds the same number before and after has read one write.
///
/// Writer:   the backend's thread.
/// Readers:  running_requests, running_request, in any process.
/// Realtime: yes.
void show_running(RunningSlot& slot, std::uint64_t number, const RunningRequest& request) noexcept;
void hide_running(RunningSlot& slot) noexcept;

/// Those that run, oldest first. A read-only mapping is enough.
std::vector<RunningRequest> running_requests(const SegmentView& view);

/// The one with this id of this lane; nothing if it does not run.
std::optional<RunningRequest> running_request(const SegmentView& view, std::uint32_t lane,
                                              std::uint64_t id) noexcept;

}  // namespace o80
