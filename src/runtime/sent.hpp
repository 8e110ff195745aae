#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "memory/lane_sender.hpp"
#include "o80/runtime/batch.hpp"
#include "runtime/link.hpp"

namespace o80 {

/// What has just been sent.
struct Sent {
  std::shared_ptr<LaneSender> lane;
  CommandId id = 0;
  std::uint32_t records = 0;
  std::uint32_t quiet = 0;  // the lane's events before
};

/// Waits until the last iteration of a burst just sent, or sent before, is done; its row, or -1 if
/// its batch was rejected. Throws TimeoutError, BackendGone, BackendHalted if it was cut,
/// Cancelled.
Iteration wait_for_burst(const Link& link, LaneSender& lane, CommandId id, Timeout timeout,
                         const KeepWaiting& keep_waiting, std::optional<std::uint32_t> quiet = {});
/// Throws BackendHalted if a halt ended some command of a batch that has ended.
void throw_if_halted(const Link& link, const Batch& batch);
/// Throws Error, or BackendHalted, with the reason why a batch was rejected.
[[noreturn]] void throw_rejected(const Link& link, const char* what, const Batch& batch);
/// Copies the row that this returned.
void read_last_row(const Link& link, Iteration row, UntypedObservation& observation);

}  // namespace o80
