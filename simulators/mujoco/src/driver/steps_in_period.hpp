#pragma once

#include <cstdint>

namespace o80::mujoco {

/// Share of a period: the rounding of a printed frequency.
inline constexpr double kPeriodTolerance = 1e-5;

/// True if `steps_in_period` would not throw.
bool is_whole_steps(std::int64_t period, double timestep, std::uint32_t steps);

/// Computes the number of engine steps (each of `timestep` [s]) in a period [ns]. `steps`:
/// requested number, 0: as many as the period holds. Throws DriverError, with an alternative, if
/// the period is not that number of steps.
std::uint32_t steps_in_period(std::int64_t period, double timestep, std::uint32_t steps);

}  // namespace o80::mujoco
