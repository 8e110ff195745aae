#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "control/batch/record.hpp"
#include "nb.hpp"
#include "o80/control/command.hpp"

// Conversions of enums, which are strings in Python (o80.base.words).

/// The place of a word among those that are known. Throws InvalidArgument, which lists them.
std::size_t place_of(nb::handle word, std::span<const std::string_view> known, const char* name);

o80::Mode mode_of(nb::handle word);
o80::Profile profile_of(nb::handle word);
o80::Profile profile_of_rows(nb::handle word);
o80::Profile profile_of_trajectory(nb::handle word);
o80::Start start_of(nb::handle word);

/// Members of o80.Status and o80.Reason.
nb::object python_word(o80::Status status);
nb::object python_word(o80::Reason reason);
