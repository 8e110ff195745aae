#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace o80 {

/// Kind of an entry of a journal. See src/runtime/README.md#journal.
enum class JournalKind : std::uint8_t {
  none,
  records,           // blocks of a batch, copied from its lane
  dropped,           // the batch that was being copied is invalid
  owner,             // the process that owns a lane
  taken,             // a batch was taken
  scheduled,         // a batch waits for its iteration
  rejected,          // a batch was rejected
  status,            // a command or request has begun or ended; written as `statuses`
  halt,              // a halt is in force
  halt_reason,       // the reason of that halt, written after it began
  resume,            // the halt was cleared
  control_taken,     // exclusive control was taken
  control_released,  // the holder has released control
  control_lost,      // the holder has closed, died or become silent
  burst,             // a burst was granted
  burst_ended,
  died,         // the owner of a lane died
  silent,       // the watchdog found the owner of a lane silent
  interrupted,  // the driver interrupted an actuator
  fresh_start,  // the queues were dropped and the robot was read again
  order_lost,   // the ticket counter was damaged: the order between lanes is reset
  stopping,     // all commands were purged; the robot brakes before it stops
  ended,        // the backend has ended
  statuses,     // several `status` in one entry; readers receive them one by one
  snapshot,     // a driver's state that was stored in a slot
  at_rest,      // nothing acts from this row on; for replays, hidden from readers
  chunk_begun   // a chunk begins: together with the rows, all inputs of the plan
};
inline constexpr std::size_t kJournalKinds = static_cast<std::size_t>(JournalKind::chunk_begun) + 1;

std::string_view to_text(JournalKind kind) noexcept;

}  // namespace o80
