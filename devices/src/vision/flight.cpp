#include "vision/flight.hpp"

#include <algorithm>
#include <cmath>

namespace o80::vision {

namespace {

constexpr double kLongestStep = 0.01;     // [s]
constexpr double kSlowestRebound = 0.05;  // [m/s]; a ball hops, and never rests

Vector acceleration(const FlightLaw& law, const Vector& velocity, const Vector& spin) noexcept {
  const double speed = length(velocity);
  const double turning = law.saturation * length(spin);
  const double magnus = turning > 0 ? law.magnus * (speed / (speed + turning)) : law.magnus;
  return magnus * cross(spin, velocity) - (law.drag * speed) * velocity + law.gravity;
}

/// Classical Runge-Kutta step, with the spin at the middle of the step.
Ball flown(const Ball& ball, const FlightLaw& law, double duration) noexcept {
  const double half = 0.5 * duration;
  const double halfway = std::exp(-law.spin_decay * half);
  const Vector spin = halfway * ball.spin;
  const Vector v1 = ball.velocity;
  const Vector a1 = acceleration(law, v1, spin);
  const Vector v2 = ball.velocity + half * a1;
  const Vector a2 = acceleration(law, v2, spin);
  const Vector v3 = ball.velocity + half * a2;
  const Vector a3 = acceleration(law, v3, spin);
  const Vector v4 = ball.velocity + duration * a3;
  const Vector a4 = acceleration(law, v4, spin);
  const double sixth = duration / 6;
  return {ball.position + sixth * (v1 + 2 * v2 + 2 * v3 + v4),
          ball.velocity + sixth * (a1 + 2 * a2 + 2 * a3 + a4), halfway * spin};
}

/// Bounces a ball on the table.
Ball bounced(const Ball& before, const FlightLaw& law) noexcept {
  const Vector& v = before.velocity;
  const Vector& spin = before.spin;
  const double rebound = std::max(-law.kept_normal * v[2], kSlowestRebound);
  // slip => change of velocity and spin by friction
  const double grip = 1 - law.kept_tangential;
  double taken_x = grip * (v[0] - law.radius * spin[1]);
  double taken_y = grip * (v[1] + law.radius * spin[0]);
  const double taken = std::hypot(taken_x, taken_y);
  const double most = law.friction * (rebound - v[2]);
  if (taken > most) {
    taken_x *= most / taken;
    taken_y *= most / taken;
  }
  const double per_velocity = 1 / (law.inertia * law.radius);
  return {before.position,
          {{v[0] - taken_x, v[1] - taken_y, rebound}},
          {{spin[0] - per_velocity * taken_y, spin[1] + per_velocity * taken_x, spin[2]}}};
}

/// Whether a step begins above the table's surface and ends below.
bool meets_table(const Ball& begin, const Ball& end, const FlightLaw& law) noexcept {
  const double height = law.table[2] + law.radius;
  return law.has_table && end.velocity[2] < 0 && begin.position[2] >= height &&
         end.position[2] < height && std::abs(end.position[0] - law.table[0]) <= law.half[0] &&
         std::abs(end.position[1] - law.table[1]) <= law.half[1];
}

/// Finds the time of a step at which the ball touches the table [s].
double time_of_touch(const Ball& ball, const FlightLaw& law, double step) noexcept {
  const double height = law.table[2] + law.radius;
  double time = 0.5 * step;
  constexpr int kSteps = 4;
  for (int i = 0; i < kSteps; ++i) {  // Newton's rule
    const Ball then = flown(ball, law, time);
    if (std::abs(then.velocity[2]) < 1e-9) break;
    time -= (then.position[2] - height) / then.velocity[2];
    time = std::clamp(time, 0.0, step);
  }
  return time;
}

}  // namespace

Ball advanced(const Ball& ball, const FlightLaw& law, double duration, int& bounces) noexcept {
  constexpr int kMaxSteps = 200;
  const int steps = std::clamp(static_cast<int>(std::ceil(duration / kLongestStep)), 1, kMaxSteps);
  const double step = duration / steps;
  Ball now = ball;
  for (int i = 0; i < steps; ++i) {
    const Ball end = flown(now, law, step);
    if (!meets_table(now, end, law)) {
      now = end;
      continue;
    }
    const double touch = time_of_touch(now, law, step);
    Ball contact = flown(now, law, touch);
    contact.position[2] = law.table[2] + law.radius;
    now = flown(bounced(contact, law), law, step - touch);
    ++bounces;
  }
  return now;
}

}  // namespace o80::vision
