#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace o80 {

/// Kind of an entry of a journal. See src/runtime/README.md#journal.
enum class JournalKind : std::uint8_t {
  none,
  records,           // blocks of a batch, as its lane had them
  dropped,           // the batch that was being copied is invalid
  owner,             // the process that owns a lane
  taken,             // a batch was taken
  scheduled,         // a batch waits for the iteration it was sent for
  rejected,          // a batch was rejected
  status,            // a command or request has begun or ended; written as `statuses`
  halt,              // a halt is in force
  halt_reason,       // the reason of that halt, written after it began
  resume,            // the halt was cleared
  control_taken,     // exclusive control was taken
  control_released,  // its holder has released it
  control_lost,      // its holder has closed, died or become silent
  burst,             // a burst was granted
  burst_ended,
  died,         // the owner of a lane died
  silent,       // the watchdog found the owner of a lane silent
  interrupted,  // the driver interrupted an actuator
  fresh_start,  // the queues were dropped and the robot was read anew
  order_lost,   // the ticket counter was damaged: the order between lanes begins anew
  stopping,     // all commands were purged; the robot brakes before it stops
  ended,        // the backend has ended
  statuses,     // many of `status` in one entry; readers get each of them
  snapshot,     // the driver keeps its state in a slot: the state
  at_rest,      // nothing acts from this row on; for replays, readers do not get it
  chunk_begun   // a chunk begins: with its rows, all that its plan depends on
};
inline constexpr std::size_t kJournalKinds = static_cast<std::size_t>(JournalKind::chunk_begun) + 1;

std::string_view to_text(JournalKind kind) noexcept;

}  // namespace o80
