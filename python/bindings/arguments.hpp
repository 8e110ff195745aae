#pragma once

#include <nanobind/nanobind.h>

#include <chrono>
#include <cstdint>
#include <string>

#include "o80/control/command.hpp"

// Conversions of Python arguments to C++. Each throws InvalidArgument with the argument's name.

bool truth_of(nanobind::handle value, const char* name);
std::string string_of(nanobind::handle value, const char* name);
double number_of(nanobind::handle value, const char* name);
std::int64_t count_of(nanobind::handle value, const char* name);

/// [s] => [ns]
std::chrono::nanoseconds nanoseconds_of(nanobind::handle value, const char* name);

/// At most one of the paces may be given.
o80::PaceSpec pace_of(nanobind::handle duration, nanobind::handle speed, nanobind::handle until,
                      nanobind::handle iterations, bool fastest = false);

/// `at`: an iteration or None; `late`: "reject" or "now".
o80::PulseOptions pulse_options(nanobind::handle at, nanobind::handle late);
