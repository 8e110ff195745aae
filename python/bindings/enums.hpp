#pragma once

#include <nanobind/nanobind.h>

#include "control/batch/record.hpp"
#include "o80/control/command.hpp"

// Conversions of enums, which are strings in Python (o80.base.words).

o80::Mode mode_of(nanobind::handle word);
o80::Profile profile_of(nanobind::handle word);
o80::Profile profile_of_rows(nanobind::handle word);
o80::Profile profile_of_trajectory(nanobind::handle word);
o80::Start start_of(nanobind::handle word);

/// Members of o80.Status and o80.Reason.
nanobind::object python_word(o80::Status status);
nanobind::object python_word(o80::Reason reason);
