#pragma once

#include <cstdint>

#include "scripts/script.hpp"

namespace o80::test {

/// The script of a seed: one to three actuators of any kinds of fields and limits, and some
/// hundred iterations in which everything happens to them that a script knows.
Script random_script(std::uint64_t seed);
/// The same with linear motion only, and without limits, resting fields and odd readings.
Script linear_script(std::uint64_t seed);
/// One to five commands of an actuator that has limits of acceleration and no bounds.
Script planned_script(std::uint64_t seed);

}  // namespace o80::test
