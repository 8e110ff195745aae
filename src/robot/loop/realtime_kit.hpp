#pragma once

#include <sys/resource.h>

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

/// Bounds the time that a real-time thread of this process may run without sleeping [us]: after
/// `soft`, or half of the hard limit if that is less, it becomes an ordinary thread and says so on
/// the standard error; at the hard limit the kernel kills the process. Returns the bound.
rlim_t limit_running(rlim_t soft, rlim_t hard);

}  // namespace o80
