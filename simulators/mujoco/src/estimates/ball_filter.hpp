#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "estimates/platform.hpp"

// Estimates of flying balls from noisy measurements: position, velocity and spin about x. After
// each measurement the estimate is the last one flown on for a step, by the laws of flight and
// bounce, plus gain times what the measurement adds. Where a ball was not seen, its estimate flies
// on alone. A velocity that no flight and no bounce explains begins a new flight.

namespace o80::mujoco {

/// Position and velocity of a measured ball [m, m/s].
using Seen = std::array<double, 6>;

/// What a measurement changes: of position and velocity x by those of x (4), then of y, z, their
/// velocities and the spin by those of y and z (20).
using Gain = std::array<double, 24>;

/// Where a ball goes through a plane of constant y: x and z [m], its velocity [m/s], and the time
/// until then [s].
using Crossing = std::array<double, 6>;

class BallFilter {
 public:
  struct Settings {
    Air air{};
    Platform platform{};
    double step = 0.01;        // from one measurement to the next [s]
    double mean_spin = 0;      // of a ball that was seen once [rad/s]
    std::vector<Gain> before;  // a gain for each measurement since the ball was first seen
    std::vector<Gain> after;   // and since its bounce; the last one goes on
  };

  /// Throws std::invalid_argument without gains.
  BallFilter(Settings settings, std::size_t count);

  std::size_t count() const noexcept { return estimates_.size(); }
  const Ball& ball(std::size_t number) const noexcept { return estimates_[number].ball; }

  /// A new flight of a ball, with its first measurement.
  void begin(std::size_t number, const Seen& seen) noexcept;
  /// A step later; without a measurement `seen` is null.
  void step(std::size_t number, const Seen* seen) noexcept;
  /// All 0 for a ball that does not come nearer to the plane from greater y, or is too absurd.
  Crossing crossing(std::size_t number, double plane) const noexcept;

 private:
  struct Estimate {
    Ball ball{};
    bool bounced = false;
    std::ptrdiff_t measured = 0;  // which gain was used last; -1: none since the bounce
  };

  bool touches(const Estimate& estimate, const Seen* seen) const noexcept;
  Ball bounced_within(const Ball& ball) const noexcept;
  Ball after_touch(const Ball& ball, double& time) const noexcept;

  Settings settings_;
  std::vector<Estimate> estimates_;
};

}  // namespace o80::mujoco
