#include "control/interpolation.hpp"

#include <algorithm>
#include <cmath>

namespace o80 {
namespace {

// rounding must not add an iteration
constexpr double kSpeedRounding = 1e-12;

std::int64_t at_least_one(double iterations) noexcept {
  const double whole = std::ceil(iterations * (1.0 - kSpeedRounding));
  if (!(whole < static_cast<double>(kMostIterations))) return kMostIterations;
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(whole));
}

}  // namespace

Fading Fading::of(const Moment& start, double most, double up, double down) noexcept {
  const bool rises = start.velocity != 0.0 ? start.velocity > 0.0 : start.acceleration > 0.0;
  const double room = rises ? up : down;
  const double v = std::abs(start.velocity);
  const double a = rises ? start.acceleration : -start.acceleration;
  if ((v == 0.0 && a == 0.0) || !(room > 0.0)) return {};

  double time = most;
  if (a < 0.0) time = std::min(time, 3.0 * v / -a);  // a longer time would reverse it
  // time (v / 2 + a time / 12) <= room
  const double discriminant = v * v / 4.0 + a * room / 3.0;
  if (discriminant > 0.0) {
    time = std::min(time, 2.0 * room / (v / 2.0 + std::sqrt(discriminant)));
  }
  if (!(time > 0.0) || !std::isfinite(time)) return {};
  return {start.velocity, start.acceleration, time};
}

double Fading::position(double t) const noexcept {
  if (t >= time) return distance();
  const double s = t / time;
  return t * (velocity * (1.0 + s * s * (-1.0 + s / 2.0)) +
              acceleration * t * (0.5 + s * (-2.0 / 3.0 + s / 4.0)));
}

Moment Fading::at(double t) const noexcept {
  if (t >= time) return {};
  const double s = t / time;
  return {(1.0 - s) * (1.0 - s) * (velocity * (1.0 + 2.0 * s) + acceleration * t),
          -6.0 * velocity * s * (1.0 - s) / time + acceleration * (1.0 + s * (-4.0 + 3.0 * s))};
}

std::int64_t linear_iterations(double distance, double speed) noexcept {
  return at_least_one(std::abs(distance) / speed);
}

std::int64_t minimum_jerk_iterations(double distance, double speed) noexcept {
  constexpr double kPeakFromRest = 1.875;
  return at_least_one(kPeakFromRest * std::abs(distance) / speed);
}

double highest_speed(double velocity, double distance, double n) noexcept {
  const double v = std::abs(velocity);
  const double mean = std::abs(distance) / n;
  if (velocity * distance <= 0.0) return std::max(v, 1.875 * mean);
  // v (1 - 3 t^2 + 2 t^3) + 30 mean t^2 (1 - t)^2 is highest where 10 mean (1 - 2 t) = v
  if (10.0 * mean <= v) return v;
  const double t = 0.5 * (1.0 - v / (10.0 * mean));
  return v * (1.0 + t * t * (-3.0 + 2.0 * t)) + mean * minimum_jerk_slope(t);
}

}  // namespace o80
