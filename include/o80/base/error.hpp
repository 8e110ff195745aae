#pragma once

#include <stdexcept>
#include <string>

namespace o80 {

/// Base of all exceptions that o80 throws; the text says what happened, to what, and what to do.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

#define O80_ERROR(Name, Base) \
  class Name : public Base {  \
   public:                    \
    using Base::Base;         \
  }

O80_ERROR(InvalidArgument, Error);          // a value the caller gave cannot be used
O80_ERROR(TimeoutError, Error);             // a wait ended without its result
O80_ERROR(SegmentTaken, Error);             // the name already has a living backend
O80_ERROR(SegmentError, Error);             // the file is not a segment of this version of o80
O80_ERROR(SchemaMismatch, Error);           // the robot's description differs from the caller's
O80_ERROR(BackendGone, Error);              // the backend no longer iterates
O80_ERROR(BackendStopped, BackendGone);     // the backend stopped without a fault
O80_ERROR(BackendFailed, BackendGone);      // the driver reported a fault
O80_ERROR(BackendKilled, BackendGone);      // the backend's process died
O80_ERROR(BackendSuperseded, BackendGone);  // a new backend took the name
O80_ERROR(BackendHalted, Error);            // commands are refused until the backend is resumed
O80_ERROR(RowOverwritten, Error);           // the history no longer holds that iteration
O80_ERROR(LaneFull, Error);                 // too many commands are in flight; nothing was sent
O80_ERROR(NoLane, Error);                   // all lanes of the segment have an owner
O80_ERROR(NotBursting, Error);              // a burst was requested from a real-time backend
O80_ERROR(ReadOnly, Error);                 // the frontend may read only
O80_ERROR(UsedAfterFork, Error);            // the object belongs to the parent process
O80_ERROR(Closed, Error);                   // the object was closed
O80_ERROR(Cancelled, Error);                // the caller's KeepWaiting returned false
O80_ERROR(DriverError, Error);              // a robot library or its driver failed

#undef O80_ERROR

}  // namespace o80
