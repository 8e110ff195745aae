#pragma once

#include <atomic>

#include "interpreter.hpp"
#include "nb.hpp"
#include "o80/base/time.hpp"

/// Cancels the waits of one thread from another thread (for a cancelled task of asyncio).
///
/// Writer:  any thread.
/// Readers: the thread that is inside `call`.
class Canceller {
 public:
  void cancel() noexcept { cancelled_.store(true, std::memory_order_relaxed); }
  /// Calls `callable`; its waits throw Cancelled within 50 ms after `cancel`.
  nb::object call(nb::handle callable);
  /// True if the call in this thread was cancelled.
  static bool cancelled_here() noexcept;

 private:
  std::atomic<bool> cancelled_{false};
};

/// Put one around every call that may block, so that other Python threads and Ctrl-C work.
///
/// Releases the GIL until it is destroyed. Pass `keep_waiting` to the call as its KeepWaiting.
class Waiting {
 public:
  /// Raises the exception of a signal handler, usually KeyboardInterrupt.
  static bool keep_waiting() {
    if (Canceller::cancelled_here()) return false;
    const WithGil locked;
    if (call_python(PyErr_CheckSignals) != 0) throw nb::python_error();
    return true;
  }

 private:
  WithoutGil released_;
};

/// Calls `work` without the GIL.
template <class Work>
auto without_gil(Work&& work) {
  const Waiting waiting;
  return work();
}

/// Converts seconds; None is for ever. Throws InvalidArgument.
o80::Timeout timeout_of(nb::handle seconds);

/// An argument `timeout`, in seconds: whoever calls the function gets InvalidArgument for others.
struct Patience {
  operator o80::Timeout() const { return timeout; }  // NOLINT(google-explicit-constructor)
  o80::Timeout timeout;
};
template <>
struct nanobind::detail::type_caster<Patience> {
  template <class>
  using Cast = Patience;
  static constexpr auto Name = const_name("float | None");
  bool from_python(handle source, std::uint32_t, cleanup_list*) noexcept {
    given = source;
    return true;
  }
  explicit operator Patience() const { return {timeout_of(given)}; }
  handle given;
};
