#pragma once

#include <optional>

#include "scripts/script_world.hpp"

namespace o80::test {

/// Plays a script and gives the first promise that it breaks.
std::optional<Failure> play(const Script& script);

/// A failure and the script that shows it, as one reads it in a test's output.
std::string report(const Script& script, const Failure& failure);

}  // namespace o80::test
