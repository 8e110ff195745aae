#pragma once

#include <cstdint>

#include "pam/plant.hpp"

// Sets of numbers for the arm, each from one source.

namespace o80::pam {

enum class Preset : std::uint8_t {
  standard,             // linear muscles with plausible motions, without dead time and friction
  identified,           // small steps like the published ones of the real arm
  published_simulation  // muscles of Hill type, as in the published simulation
};

/// Pressure above the atmosphere of a muscle's maximum force, if activation follows the pressure
/// [bar]: a change of one bar then has the same effect as in the simulated ranges.
inline constexpr double kFullBar = 3.6;

/// Ranges in which activation follows the pressure above the atmosphere, from 0 to `full` [bar].
PressureRanges in_bar(PressureRanges ranges, double full) noexcept;

Plant::Config preset(Preset preset) noexcept;

}  // namespace o80::pam
