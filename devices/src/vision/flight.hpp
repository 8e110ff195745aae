#pragma once

#include <array>

#include "vision/matrix.hpp"

namespace o80::vision {

/// Position [m], velocity [m/s] and spin [rad/s] of a ball, in the world.
struct Ball {
  Vector position, velocity, spin;
};

/// Effects of air, gravity and table on the ball. The same law, with the same names, is in the
/// simulator (simulators/mujoco/src/balls: ball_flight.hpp, bounce.hpp) and in the table-tennis
/// application; a test compares them.
struct FlightLaw {
  // a = -drag |v| v + magnus / (1 + saturation |omega| / |v|) (omega x v) + gravity
  double drag = 0.1099;      // [1/m]
  double magnus = 0.00627;   // []
  double saturation = 0.06;  // of the lift [m]
  double spin_decay = 0.5;   // share of the spin lost in a second [1/s]
  Vector gravity{{0, 0, -9.81}};

  double radius = 0.02;        // [m]
  double inertia = 2.0 / 3.0;  // / (mass radius^2)

  bool has_table = true;
  Vector table{{0, 0, 0}};                   // middle of the surface [m]
  std::array<double, 2> half{0.7625, 1.37};  // half size of the surface, along x and y [m]
  double kept_normal = 0.92;                 // kept share of the velocity along the normal
  double kept_tangential = 0.505;            // kept share along the surface, without spin
  double friction = 0.25;
};

/// Moves a ball by `duration` [s], with bounces on the way. `bounces` is increased by their
/// number.
Ball advanced(const Ball& ball, const FlightLaw& law, double duration, int& bounces) noexcept;

}  // namespace o80::vision
