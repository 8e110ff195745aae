#include "driver/steps_in_period.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

// times in [ns]

[[noreturn]] void refuse_steps(double period, double step, std::uint32_t steps) {
  char text[400];
  std::snprintf(text, sizeof text,
                "%u steps of %g ms make iterations of %g ms, not of %g ms (%g Hz). Ask for "
                "%g Hz, or leave out either the frequency or steps",
                steps, step * 1e-6, steps * step * 1e-6, period * 1e-6, 1e9 / period,
                1e9 / (steps * step));
  throw DriverError(text);
}

[[noreturn]] void refuse_period(double period, double step) {
  const double fewer = std::floor(period / step);
  const double more = fewer + 1;
  char slower[40] = "";
  if (fewer > 0) std::snprintf(slower, sizeof slower, " or %g", 1e9 / (more * step));
  char text[400];
  std::snprintf(text, sizeof text,
                "%g Hz (iterations of %g ms) is not a whole number of the model's steps of %g ms. "
                "Ask for %g%s Hz, leave the frequency out (%g Hz), or give timestep=%.9g [s]",
                1e9 / period, period * 1e-6, step * 1e-6, 1e9 / (std::max(1.0, fewer) * step),
                slower, 1e9 / step, period / more * 1e-9);
  throw DriverError(text);
}

double nearest_count(double period, double step, std::uint32_t steps) {
  return steps > 0 ? steps : std::max(1.0, std::round(period / step));
}

}  // namespace

bool is_whole_steps(std::int64_t period, double timestep, std::uint32_t steps) {
  const auto requested = static_cast<double>(period);
  const double error = nearest_count(requested, timestep * 1e9, steps) * timestep * 1e9 - requested;
  return std::abs(error) <= kPeriodTolerance * requested;
}

std::uint32_t steps_in_period(std::int64_t period, double timestep, std::uint32_t steps) {
  const double step = timestep * 1e9;
  const auto requested = static_cast<double>(period);
  if (is_whole_steps(period, timestep, steps)) {
    return static_cast<std::uint32_t>(nearest_count(requested, step, steps));
  }
  if (steps > 0) refuse_steps(requested, step, steps);
  refuse_period(requested, step);
}

}  // namespace o80::mujoco
