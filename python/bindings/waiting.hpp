#pragma once

#include <nanobind/nanobind.h>

#include <atomic>

#include "interpreter.hpp"
#include "o80/base/time.hpp"

/// Ends the waits of one thread from another one (a cancelled task of asyncio).
///
/// Writer:  any thread.
/// Readers: the thread that is inside `call`.
class Canceller {
 public:
  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  /// Calls it; what waits in there raises Cancelled within 50 ms of `cancel`.
  nanobind::object call(nanobind::handle callable);
  /// Whether the call that this thread is in was cancelled.
  static bool cancelled_here() noexcept;

 private:
  std::atomic<bool> cancelled_{false};
};

/// Around every call that may block: other Python threads run on, and Ctrl-C comes through.
///
/// Lets go of the GIL until it is destroyed; `keep_waiting` goes into the call as KeepWaiting.
class Waiting {
 public:
  /// Raises what a signal's handler raised, usually KeyboardInterrupt.
  static bool keep_waiting() {
    if (Canceller::cancelled_here()) return false;
    const WithGil locked;
    if (call_python(PyErr_CheckSignals) != 0) throw nanobind::python_error();
    return true;
  }

 private:
  WithoutGil released_;
};

/// From seconds; None is for ever. Throws InvalidArgument.
o80::Timeout timeout_of(nanobind::handle seconds);
