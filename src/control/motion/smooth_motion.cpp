#include "control/motion/smooth_motion.hpp"

#include <algorithm>
#include <cmath>

#include "base/whole.hpp"
#include "control/motion/visit_block.hpp"

namespace o80 {
namespace {

/// A polynomial c[0] + c[1] i + c[2] i^2.
struct Quadratic {
  double c[3];
  double at(double i) const noexcept { return c[0] + i * (c[1] + i * c[2]); }
  /// Calls `visit` with the iterations from 1 to `last` next to its roots, at most four.
  template <class Visit>
  void near_roots(double last, Visit&& visit) const noexcept {
    const auto around = [&](double root) {
      // a root may be huge, infinite or NaN
      if (!(root > 0.0 && root < last + 1.0)) return;
      const double below = whole_below(root);
      if (below >= 1.0) visit(below);
      if (below + 1.0 <= last) visit(below + 1.0);
    };
    const double discriminant = c[1] * c[1] - 4.0 * c[2] * c[0];
    if (!(discriminant >= 0.0)) return;
    const double q = -0.5 * (c[1] + std::copysign(std::sqrt(discriminant), c[1]));
    around(q / c[2]);
    around(c[0] / q);
  }
};

}  // namespace

SmoothMotion::SmoothMotion(const Moment& start, double target, std::int64_t iterations) noexcept
    : last_(static_cast<double>(iterations)), target_(target) {
  O80_COUNT(smooth_motion);
  const double n = last_;
  const double d = start.position - target;
  const double v = start.speed;
  const double a = start.acceleration;
  // Newton's form through iterations 0, -1, -2. The differences are written out, because
  // subtracting the values would cancel.
  const double three = n * (n + 1.0) * (n + 2.0);
  c0_ = -d / three;
  c1_ = -(3.0 * d + n * v) / (three * (n + 3.0));
  c2_ = -(6.0 * d + 3.0 * n * v + n * (n + 1.0) / 2.0 * a) / (three * (n + 3.0) * (n + 4.0));
}

/// The differences are, like the position, a product of known factors and a quadratic, whose roots
/// are the extremes of the difference below it.
SmoothMotion::Extremes SmoothMotion::extremes() const noexcept {
  const double n = last_;
  // v(i) = (n - i + 1)(n - i + 2) u(i); a(i) = (n - i + 2) h(i); j(i) = k(i)
  const Quadratic u{{3.0 * c0_ - (n + 3.0) * c1_, 4.0 * c1_ - (2.0 * n + 3.0) * c2_, 5.0 * c2_}};
  const auto [u0, u1, u2] = u.c;
  const Quadratic h{{(n + 3.0) * (u1 - u2) - 2.0 * u0, u2 * (2.0 * n + 7.0) - 3.0 * u1, -4.0 * u2}};
  const auto [h0, h1, h2] = h.c;
  const Quadratic k{{(n + 3.0) * (h1 - h2) - h0, h2 * (2.0 * n + 7.0) - 2.0 * h1, -3.0 * h2}};

  Extremes all{{target_, target_}, {}, 0.0, 0.0};
  const auto widen = [](double& most, double value) { most = std::max(most, std::abs(value)); };
  const auto place = [&](double i) { all.positions.include(position(i)); };
  const auto speed = [&](double i) { all.speeds.include((n - i + 1.0) * (n - i + 2.0) * u.at(i)); };
  const auto acceleration = [&](double i) { widen(all.acceleration, (n - i + 2.0) * h.at(i)); };
  const auto jerk = [&](double i) { widen(all.jerk, k.at(i)); };

  place(1.0);
  u.near_roots(n, place);
  speed(1.0);
  speed(n);
  h.near_roots(n, speed);
  acceleration(1.0);
  acceleration(n + 1.0);
  k.near_roots(n + 1.0, acceleration);
  jerk(1.0);
  jerk(n + 2.0);
  const double vertex = whole_below(-0.5 * k.c[1] / k.c[2]);
  if (vertex >= 1.0 && vertex <= n + 1.0) {
    jerk(vertex);
    jerk(vertex + 1.0);
  }
  return all;
}

}  // namespace o80
