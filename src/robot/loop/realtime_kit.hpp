#pragma once

#include <optional>
#include <string>

namespace o80 {

/// Asks RealtimeKit, a service of desktops, to give the calling thread a real-time priority: the
/// one wanted, or the highest that it grants. Takes a second at most. Returns what it answered, as
/// a part of a sentence.
///
/// RealtimeKit demands that the kernel bounds the time that a thread may run without sleeping, and
/// kills the process beyond it. At half of that time the thread becomes an ordinary one instead.
///
/// Realtime: no.
std::string ask_realtime_kit(int priority);

/// A line for the operator, once, after a thread has lost the priority of RealtimeKit because it
/// did not sleep.
std::optional<std::string> lost_priority();

}  // namespace o80
