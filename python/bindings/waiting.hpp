#pragma once

#include <nanobind/nanobind.h>

#include <chrono>
#include <cmath>
#include <optional>

#include "interpreter.hpp"
#include "o80/base/error.hpp"
#include "o80/base/time.hpp"

/// Around every call that may block: other Python threads run on, and Ctrl-C comes through.
///
/// Lets go of the GIL until it is destroyed; `keep_waiting` goes into the call as KeepWaiting.
class Waiting {
 public:
  /// Raises what a signal's handler raised, usually KeyboardInterrupt.
  static bool keep_waiting() {
    const WithGil locked;
    if (call_python(PyErr_CheckSignals) != 0) throw nanobind::python_error();
    return true;
  }

 private:
  WithoutGil released_;
};

/// From seconds; None is for ever.
inline o80::Timeout timeout_of(std::optional<double> seconds) {
  constexpr double kLongest = 1e9;  // [s]
  if (!seconds || *seconds > kLongest) return {};
  if (std::isnan(*seconds)) throw o80::InvalidArgument("a timeout cannot be NaN");
  return std::chrono::nanoseconds(std::llround(std::fmax(*seconds, 0.0) * 1e9));
}
