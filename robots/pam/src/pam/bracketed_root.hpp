#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace o80::pam {

/// Finds the root of `f` between `low` and `high`, where the signs of `f` must differ. Brent's
/// method (1973): inverse interpolation, or bisection without convergence. Exact to rounding.
template <class F>
double bracketed_root(const F& f, double low, double high) noexcept {
  double previous = low, f_previous = f(low);
  double best = high, f_best = f(high);
  double other = previous, f_other = f_previous;  // the far end of the bracket
  double step = best - previous, last_step = step;

  for (int i = 0; i < 100 && f_best != 0.0; ++i) {
    // keep the root between best and other; best has the smaller |f|
    if ((f_best > 0.0) == (f_other > 0.0)) {
      other = previous, f_other = f_previous;
      step = last_step = best - previous;
    }
    if (std::abs(f_other) < std::abs(f_best)) {
      previous = best, f_previous = f_best;
      std::swap(best, other), std::swap(f_best, f_other);
    }
    const double tolerance = 2.0 * std::numeric_limits<double>::epsilon() * std::abs(best) +
                             std::numeric_limits<double>::min();
    const double half = 0.5 * (other - best);
    if (std::abs(half) <= tolerance) break;

    // secant or inverse parabola, if well inside the bracket; else the middle
    const double two_steps_ago = last_step;
    last_step = step;
    step = half;
    if (std::abs(two_steps_ago) >= tolerance && std::abs(f_previous) > std::abs(f_best)) {
      const double s = f_best / f_previous;
      double p = 2.0 * half * s;
      double q = 1.0 - s;
      if (previous != other) {
        const double r = f_best / f_other;
        const double t = f_previous / f_other;
        p = s * (2.0 * half * t * (t - r) - (best - previous) * (r - 1.0));
        q = (t - 1.0) * (r - 1.0) * (s - 1.0);
      }
      if (p > 0.0) q = -q;
      p = std::abs(p);
      if (2.0 * p <
          std::min(3.0 * half * q - std::abs(tolerance * q), std::abs(two_steps_ago * q))) {
        step = p / q;
      } else {
        last_step = half;
      }
    } else {
      last_step = half;
    }
    previous = best, f_previous = f_best;
    best += std::abs(step) > tolerance ? step : std::copysign(tolerance, half);
    f_best = f(best);
  }
  return best;
}

}  // namespace o80::pam
