#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "memory/ring/lane_sender.hpp"
#include "o80/runtime/batch.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/frontend/sent_commands.hpp"

namespace o80 {

/// Adds the command of UntypedFrontend::add_commands to a batch. Needs Link::sending.
std::uint32_t add_commands_to(Link& link, BatchBuilder& builder,
                              std::span<const std::uint32_t> actuators,
                              std::span<const std::byte> states, const CommandOptions& options,
                              std::span<const std::uint64_t> masks);

/// Result of send().
struct Sent {
  std::shared_ptr<LaneSender> lane;
  CommandId id = 0;
  std::uint32_t records = 0;
  std::uint32_t clipped = 0;
  std::uint32_t events_before_send = 0;  // event count of the lane before the batch was sent
  std::optional<Seen> seen;
  std::vector<SentCommand> commands;  // empty for a burst whose batch nobody gets
};

/// Whether the statuses of a batch will be read.
enum class Statuses : std::uint8_t { noted, unread };
BatchRecord batch_of(const PulseOptions& options);
/// Throws what refuses the batch now, as far as it can be known; else its lane. Needs
/// Link::sending.
std::shared_ptr<LaneSender> refuse_unless_sendable(Link& link, BatchBuilder& builder,
                                                   const BatchRecord& wanted,
                                                   const std::optional<Seen>& seen);
/// Seals a batch, sends it, and lets an inline robot take it. Without a record and a burst nothing
/// is sent, and the result has no lane.
Sent send(Link& link, BatchBuilder& builder, const BatchRecord& wanted,
          const std::optional<Seen>& seen, Statuses statuses = Statuses::noted);

/// Waits until burst `id` is done; returns its last row, or -1 if its batch was rejected.
/// `events_before_send`: the event count before it was sent, if it has just been sent. Throws
/// TimeoutError, BackendGone, Cancelled, and BackendHalted if a halt cut the burst.
Iteration wait_for_burst(const Link& link, LaneSender& lane, CommandId id, Timeout timeout,
                         const KeepWaiting& keep_waiting,
                         std::optional<std::uint32_t> events_before_send = {});
/// UntypedFrontend::burst with the records of `builder`.
UntypedObservation burst_of(const std::shared_ptr<Link>& link, BatchBuilder& builder,
                            std::int64_t iterations, Timeout timeout,
                            const KeepWaiting& keep_waiting, const PulseOptions& options);
/// Throws BackendHalted for a burst whose last row this is.
[[noreturn]] void throw_cut(const Link& link, Iteration last);
/// Throws Error, BackendHalted or BackendGone, with the reason why a batch was rejected.
[[noreturn]] void throw_rejected(Link& link, const char* what, const Batch& batch);
/// Copies the row that wait_for_burst returned. Throws RowOverwritten.
void read_last_row(const Link& link, Iteration row, UntypedObservation& observation);

}  // namespace o80
