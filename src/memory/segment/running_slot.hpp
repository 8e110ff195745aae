#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "memory/segment/segment_layout.hpp"
#include "o80/base/time.hpp"

// The requests that a driver serves over several iterations, as shown in the segment file.

namespace o80 {

/// A request that has begun and not ended.
struct RunningRequest {
  std::uint32_t request = 0;  // index in the schema
  std::uint32_t lane = 0;
  std::uint64_t id = 0;              // id within its lane
  Iteration since = -1;              // iteration in which it was taken
  std::array<char, 64> who{};        // the process that sent it
  std::array<char, 248> progress{};  // text of the driver

  std::string_view who_text() const noexcept { return who.data(); }
  std::string_view progress_text() const noexcept { return progress.data(); }
};

/// Shows a running request and its progress. `number` must be positive and differ from that of
/// every earlier write, so that a reader can detect a torn read by comparing it before and after.
///
/// Writer:   the backend's thread.
/// Readers:  running_requests, running_request, in any process.
/// Realtime: yes.
void show_running(RunningSlot& slot, std::uint64_t number, const RunningRequest& request) noexcept;
/// Marks the slot as unused, when the request has ended.
void hide_running(RunningSlot& slot) noexcept;

/// All running requests, oldest first. A read-only mapping is enough.
std::vector<RunningRequest> running_requests(const SegmentView& view);

/// The running request with this id of this lane, if any.
std::optional<RunningRequest> running_request(const SegmentView& view, std::uint32_t lane,
                                              std::uint64_t id) noexcept;

}  // namespace o80
