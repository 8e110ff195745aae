#include "o80/control/interpolation.hpp"

#include <algorithm>
#include <cmath>

namespace o80 {
namespace {

// a speed may be missed by no more than rounding
constexpr double kSpeedRounding = 1e-12;
constexpr int kMostTries = 96;

std::int64_t at_least_one(double iterations) noexcept {
  const double whole = std::ceil(iterations * (1.0 - kSpeedRounding));
  if (!(whole < static_cast<double>(kMostIterations))) return kMostIterations;
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(whole));
}

}  // namespace

double peak_speed(const Quintic& quintic) noexcept {
  const double d = quintic.distance;
  const double v = quintic.velocity;
  const double a = quintic.acceleration;
  double peak = std::abs(v);
  const auto consider = [&](double t) {
    if (t > 0.0 && t < 1.0) {
      peak = std::max(peak, std::abs(quintic.at(QuinticWeights::slope(t))));
    }
  };

  // the acceleration is (1 - t) (a + b t + c t^2), being zero at the end
  const double b = 60.0 * d - 36.0 * v - 8.0 * a;
  const double c = -120.0 * d + 60.0 * v + 10.0 * a;
  const double discriminant = b * b - 4.0 * a * c;
  if (discriminant < 0.0) return peak;
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
  if (c != 0.0) consider(q / c);
  if (q != 0.0) consider(a / q);
  return peak;
}

std::int64_t linear_iterations(double distance, double speed) noexcept {
  return at_least_one(std::abs(distance) / speed);
}

std::int64_t minimum_jerk_iterations(double distance, const Moment& start, double speed) noexcept {
  constexpr double kPeakFromRest = 1.875;
  const double way = std::abs(distance);
  if (start.velocity == 0.0 && start.acceleration == 0.0) {
    return at_least_one(kPeakFromRest * way / speed);
  }
  const double highest = std::max(speed, std::abs(start.velocity)) * (1.0 + kSpeedRounding);
  const auto peak = [&](std::int64_t n) {
    const auto count = static_cast<double>(n);
    return peak_speed(Quintic::from(distance, start, count)) / count;
  };

  // up from the fewest that the mean speed allows, in growing steps
  std::int64_t tried = at_least_one(way / highest);
  std::int64_t failed = tried - 1;
  std::int64_t gentlest = tried;
  double lowest = peak(tried);
  for (int tries = 0; tries < kMostTries && tried < kMostIterations && !(lowest <= highest);
       ++tries) {
    failed = tried;
    tried = std::min(tried + 1 + tried / 8, kMostIterations);
    const double reached = peak(tried);
    if (reached < lowest) {
      lowest = reached;
      gentlest = tried;
    }
  }
  if (!(lowest <= highest)) return gentlest;

  // down to the fewest between the last that failed and the first that will do
  std::int64_t fits = gentlest;
  while (fits - failed > 1) {
    const std::int64_t middle = failed + (fits - failed) / 2;
    (peak(middle) <= highest ? fits : failed) = middle;
  }
  return fits;
}

}  // namespace o80
