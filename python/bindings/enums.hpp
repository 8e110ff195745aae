#pragma once

#include "control/batch/record.hpp"
#include "nb.hpp"
#include "o80/control/command.hpp"

// Conversions of enums, which are strings in Python (o80.base.words).

o80::Mode mode_of(nb::handle word);
o80::Profile profile_of(nb::handle word);
o80::Profile profile_of_rows(nb::handle word);
o80::Profile profile_of_trajectory(nb::handle word);
o80::Start start_of(nb::handle word);

/// Members of o80.Status and o80.Reason.
nb::object python_word(o80::Status status);
nb::object python_word(o80::Reason reason);
