#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "nb.hpp"
#include "o80/control/command.hpp"

// Conversions of Python arguments to C++. Each throws InvalidArgument with the argument's name.

std::string repr_of(nb::handle value);  // repr()
/// Throws InvalidArgument: `what` must be `needed`, got `value`. Clears an error of Python.
[[noreturn]] void refuse(const std::string& what, const std::string& needed, nb::handle value);

bool truth_of(nb::handle value, const char* name);
std::string string_of(nb::handle value, const char* name);
/// str() of any object, made printable, or `otherwise`; for texts that are only shown. Bytes that
/// Python could not decode (surrogateescape) are read as UTF-8, other surrogates are escaped.
std::string shown_text(nb::handle value, const char* otherwise = "(no text)") noexcept;
double number_of(nb::handle value, const char* name, const char* needed = "a number");
std::int64_t count_of(nb::handle value, const char* name);

/// [s] => [ns]
std::chrono::nanoseconds nanoseconds_of(nb::handle value, const char* name);

/// At most one pace may be given; a profile of None is the default one. `period`: of the robot
/// [ns], for an `every` in iterations. `of_rows`: of a trajectory.
o80::CommandOptions command_options(nb::handle duration, nb::handle speed, nb::handle until,
                                    nb::handle iterations, nb::handle fastest, nb::handle mode,
                                    nb::handle profile, nb::handle start, nb::handle every,
                                    std::int64_t period, bool of_rows = false);
/// True for a list, a tuple or an array; false for a text.
bool is_sequence(nb::handle value);
bool is_sequence_of(nb::handle value, std::size_t length);

/// The row by which a batch was decided: an o80.Observation, an o80.Seen, or None.
std::optional<o80::Seen> seen_of(nb::handle seen);
/// `at`: an iteration or None; `late`: "reject" or "now"; `seen`: as above.
o80::PulseOptions pulse_options(nb::handle at, nb::handle late, nb::handle seen);
