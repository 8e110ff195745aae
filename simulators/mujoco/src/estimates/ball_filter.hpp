#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "estimates/platform.hpp"

// Estimates of flying balls from noisy measurements: position, velocity and spin about x. After
// each measurement, the estimate is the prediction of the last one by the laws of flight and
// bounce, plus gain times innovation. Without a measurement, the estimate is the prediction.
// A velocity that no flight and no bounce explains begins a new flight.

namespace o80::mujoco {

/// Position and velocity of a measured ball [m, m/s].
using Seen = std::array<double, 6>;

/// Gains: position and velocity along x by measurements along x (4), then y, z, their
/// velocities and the spin by measurements along y and z (20).
using Gain = std::array<double, 24>;

/// Crossing of a plane of constant y by a ball: x and z [m], velocity [m/s], and time
/// until then [s].
using Crossing = std::array<double, 6>;

class BallFilter {
 public:
  struct Settings {
    Air air{};
    Platform platform{};
    double step = 0.01;        // interval of measurements [s]
    double mean_spin = 0;      // of a ball with one measurement [rad/s]
    std::vector<Gain> before;  // a gain for each measurement since the first sighting
    std::vector<Gain> after;   // and since the bounce; the last one repeats
  };

  /// Throws std::invalid_argument without gains.
  BallFilter(Settings settings, std::size_t count);

  std::size_t count() const noexcept { return estimates_.size(); }
  const Ball& ball(std::size_t number) const noexcept { return estimates_[number].ball; }

  /// Begins a flight of a ball with its first measurement.
  void begin(std::size_t number, const Seen& seen) noexcept;
  /// Updates after a step; `seen`: measurement, or null.
  void step(std::size_t number, const Seen* seen) noexcept;
  /// All 0 for a ball that does not approach the plane from greater y, or is implausible.
  Crossing crossing(std::size_t number, double plane) const noexcept;

 private:
  struct Estimate {
    Ball ball{};
    bool bounced = false;
    std::ptrdiff_t measured = 0;  // index of the last used gain; -1: none since the bounce
  };

  bool touches(const Estimate& estimate, const Seen* seen) const noexcept;
  Ball bounced_within(const Ball& ball) const noexcept;
  Ball after_touch(const Ball& ball, double& time) const noexcept;

  Settings settings_;
  std::vector<Estimate> estimates_;
};

}  // namespace o80::mujoco
