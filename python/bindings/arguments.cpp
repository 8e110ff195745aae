#include "arguments.hpp"

#include <cmath>
#include <string>

#include "base/printable.hpp"
#include "control/batch/record.hpp"
#include "enums.hpp"
#include "o80/base/error.hpp"
#include "observation.hpp"
#include "waiting.hpp"

using o80::InvalidArgument;

std::string repr_of(nb::handle value) { return nb::cast<std::string>(nb::repr(value)); }

void refuse(const std::string& what, const std::string& needed, nb::handle value) {
  PyErr_Clear();
  throw InvalidArgument(what + " must be " + needed + ", got " + repr_of(value));
}

bool truth_of(nb::handle value, const char* name) {
  if (!PyBool_Check(value.ptr())) refuse(name, "True or False", value);
  return value.ptr() == Py_True;
}

std::string string_of(nb::handle value, const char* name) {
  if (!PyUnicode_Check(value.ptr())) refuse(name, "a string", value);
  Py_ssize_t size = 0;
  const char* text = PyUnicode_AsUTF8AndSize(value.ptr(), &size);
  if (text == nullptr) refuse(name, "valid Unicode", value);  // a lone surrogate
  return {text, static_cast<std::size_t>(size)};
}

std::string shown_text(nb::handle value, const char* otherwise) noexcept {
  const nb::object text = nb::steal(PyObject_Str(value.ptr()));
  for (const char* surrogates : {"surrogateescape", "backslashreplace"}) {
    if (!text.is_valid()) break;
    const nb::object bytes = nb::steal(PyUnicode_AsEncodedString(text.ptr(), "utf-8", surrogates));
    if (bytes.is_valid()) {
      return o80::printable({PyBytes_AS_STRING(bytes.ptr()),
                             static_cast<std::size_t>(PyBytes_GET_SIZE(bytes.ptr()))});
    }
    PyErr_Clear();
  }
  PyErr_Clear();
  return otherwise;
}

double number_of(nb::handle value, const char* name, const char* needed) {
  const double number = PyFloat_AsDouble(value.ptr());
  if ((number == -1.0 && PyErr_Occurred() != nullptr) || std::isnan(number)) {
    refuse(name, needed, value);
  }
  return number;
}

std::int64_t count_of(nb::handle value, const char* name) {
  const nb::object index = nb::steal(PyNumber_Index(value.ptr()));
  std::int64_t number = 0;
  if (!index.is_valid() || !nb::try_cast<std::int64_t>(index, number)) {
    PyErr_Clear();
    throw InvalidArgument(std::string(name) + " must be a whole number, got " + repr_of(value) +
                          (PyFloat_Check(value.ptr()) != 0
                               ? ": it counts iterations, which are seconds x frequency"
                               : ""));
  }
  return number;
}

std::chrono::nanoseconds nanoseconds_of(nb::handle value, const char* name) {
  const double seconds = number_of(value, name);
  const double limit = static_cast<double>(o80::kLongestDuration) * 1e-9;
  if (std::abs(seconds) > limit) {
    throw InvalidArgument(std::string(name) + " must be at most " + std::to_string(limit) +
                          " s, got " + std::to_string(seconds));
  }
  return std::chrono::nanoseconds(std::llround(seconds * 1e9));
}

o80::Timeout timeout_of(nb::handle seconds) {
  constexpr double kLongest = 1e9;  // [s]
  if (seconds.is_none()) return {};
  const double number =
      number_of(seconds, "timeout", "a number of seconds, or None for no timeout");
  if (number > kLongest) return {};
  return std::chrono::nanoseconds(std::llround(std::fmax(number, 0.0) * 1e9));
}

namespace {

o80::PaceSpec pace_of(nb::handle duration, nb::handle speed, nb::handle until,
                      nb::handle iterations, nb::handle fastest) {
  o80::PaceSpec pace = o80::direct();
  int given = 0;
  if (!duration.is_none() && ++given == 1) {
    pace = o80::duration(nanoseconds_of(duration, "duration"));
  }
  if (!speed.is_none() && ++given == 1) pace = o80::speed(number_of(speed, "speed"));
  if (!until.is_none() && ++given == 1) pace = o80::until(count_of(until, "until"));
  if (!iterations.is_none() && ++given == 1) {
    pace = o80::iterations(count_of(iterations, "iterations"));
  }
  if (truth_of(fastest, "fastest") && ++given == 1) pace = o80::fastest();
  if (given > 1) {
    throw InvalidArgument(
        "a command has one pace: give one of duration, speed, until, iterations and fastest (or "
        "none for a set-point, which goes as fast as the limits allow)");
  }
  return pace;
}

/// `every`: time between the set-points of a stream, seconds, or iterations if it is an integer.
void set_every(o80::PaceSpec& pace, nb::handle every, std::int64_t period) {
  if (pace.pace != o80::Pace::direct) {
    throw o80::InvalidArgument(
        "every is for set-points, which have no pace: leave out every, or the pace");
  }
  const bool counts = PyIndex_Check(every.ptr()) != 0;
  if (PyBool_Check(every.ptr()) != 0 || (counts && count_of(every, "every") > INT64_MAX / period)) {
    refuse("every", "seconds or a number of iterations", every);
  }
  const std::chrono::nanoseconds time =
      counts ? std::chrono::nanoseconds(count_of(every, "every") * period)
             : nanoseconds_of(every, "every");
  if (time.count() <= 0) refuse("every", "positive", every);
  pace = o80::direct(time);
}

}  // namespace

o80::CommandOptions command_options(nb::handle duration, nb::handle speed, nb::handle until,
                                    nb::handle iterations, nb::handle fastest, nb::handle mode,
                                    nb::handle profile, nb::handle start, nb::handle every,
                                    std::int64_t period, bool of_rows) {
  o80::CommandOptions options{.pace = pace_of(duration, speed, until, iterations, fastest),
                              .mode = mode_of(mode),
                              .start = start_of(start)};
  if (!profile.is_none()) {
    options.profile = of_rows ? profile_of_trajectory(profile) : profile_of(profile);
  }
  if (!every.is_none()) set_every(options.pace, every, period);
  return options;
}

bool is_sequence(nb::handle value) {
  return PySequence_Check(value.ptr()) != 0 && PyUnicode_Check(value.ptr()) == 0;
}

bool is_sequence_of(nb::handle value, std::size_t length) {
  if (!is_sequence(value)) return false;
  const Py_ssize_t found = PySequence_Size(value.ptr());
  if (found < 0) PyErr_Clear();  // an array without axes
  return found == static_cast<Py_ssize_t>(length);
}

std::optional<o80::Seen> seen_of(nb::handle seen) {
  if (seen.is_none()) return {};
  o80::Seen found;
  if (nb::isinstance<Observation>(seen)) {
    found = nb::inst_ptr<Observation>(seen)->row;
  } else if (nb::isinstance<o80::Seen>(seen)) {
    found = *nb::inst_ptr<o80::Seen>(seen);
  } else {
    refuse("seen",
           "the observation by which you decided, as latest(), wait_for_next() or history()[i] "
           "returns it",
           seen.type());
  }
  return found;
}

o80::PulseOptions pulse_options(nb::handle at, nb::handle late, nb::handle seen) {
  o80::PulseOptions options;
  if (!at.is_none()) {
    options.at = count_of(at, "at");
    // -1 (kNow) is valid inside of o80 only
    if (options.at < 0) {
      throw InvalidArgument("at must be at least iteration 0, got " + std::to_string(options.at));
    }
  }
  constexpr std::string_view kWords[] = {"reject", "now"};
  options.late = static_cast<o80::PulseOptions::Late>(place_of(late, kWords, "late"));
  options.seen = seen_of(seen);
  return options;
}
