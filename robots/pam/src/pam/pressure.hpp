#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace o80::pam {

inline constexpr std::size_t kJoints = 4;
inline constexpr std::size_t kMuscles = 2 * kJoints;

/// One number for each joint, from the base to the wrist.
using Joints = std::array<double, kJoints>;

/// The muscle that turns `joint` towards larger angles.
constexpr std::size_t agonist(std::size_t joint) noexcept { return 2 * joint; }
/// The muscle that turns `joint` towards smaller angles.
constexpr std::size_t antagonist(std::size_t joint) noexcept { return 2 * joint + 1; }

/// Raw pressures of the eight muscles: agonist and antagonist of joint 1, then those of joint 2, 3
/// and 4.
using Pressures = std::array<std::int32_t, kMuscles>;

constexpr Pressures equal_pressures(std::int32_t raw) noexcept {
  return {raw, raw, raw, raw, raw, raw, raw, raw};
}

/// Rounds to the nearest integer, halves away from zero: std::lround without a call.
constexpr std::int32_t rounded(double raw) noexcept {
  const auto whole = static_cast<std::int32_t>(raw);
  const double rest = raw - whole;
  return whole + (rest >= 0.5) - (rest <= -0.5);
}

/// Pressure above the atmosphere [bar]; 18000 is 1.81 bar.
constexpr double to_bar(double raw) noexcept { return 0.0002 * raw - 1.7888; }

/// Raw pressure of a pressure in bar above the atmosphere.
constexpr double from_bar(double bar) noexcept { return (bar + 1.7888) / 0.0002; }

/// Range of a muscle's raw pressures, and the pressures of zero and full activation, by default
/// the ends of the range.
struct PressureRange {
  std::int32_t minimum = 6000;
  std::int32_t maximum = 24000;
  double idle = minimum;
  double full = maximum;

  constexpr double activation(std::int32_t raw) const noexcept {
    return (raw - idle) / (full - idle);
  }
  constexpr double pressure(double activation) const noexcept {
    return idle + activation * (full - idle);
  }
  /// Activations at the least and the largest pressure.
  constexpr double least() const noexcept { return activation(minimum); }
  constexpr double most() const noexcept { return activation(maximum); }
};

using PressureRanges = std::array<PressureRange, kMuscles>;

/// The ranges of the published simulation: the same for all muscles.
inline constexpr PressureRanges kSimulatedRanges{};

/// The ranges of the real arm, in the order of `Pressures`.
inline constexpr PressureRanges kRealRanges{{{15000, 25000},
                                             {16000, 25000},
                                             {15000, 21500},
                                             {16000, 25000},
                                             {13000, 21000},
                                             {13000, 21000},
                                             {13000, 19000},
                                             {13000, 21900}}};

}  // namespace o80::pam
