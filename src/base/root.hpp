#pragma once

#include <cmath>

namespace o80 {

/// The root of an increasing function between `low` and `high`, up to a function value of
/// `tolerance`; by the Illinois method, with a bisection in every eighth step. `low` or `high` if
/// there is none between them.
///
/// Realtime: yes; at most 62 calls.
template <class Function>
double root(Function&& function, double low, double high, double tolerance) noexcept {
  double at_low = function(low);
  if (at_low >= 0.0) return low;
  double at_high = function(high);
  if (at_high <= 0.0) return high;
  constexpr int kMax = 60;
  int side = 0;
  for (int i = 0; i < kMax; ++i) {
    const double width = high - low;
    if (!(width > 1e-15 * std::abs(high))) break;
    double tried = i % 8 == 7 ? low + width / 2.0 : high - at_high * width / (at_high - at_low);
    if (!(tried > low && tried < high)) tried = low + width / 2.0;
    const double value = function(tried);
    if (std::abs(value) <= tolerance) return tried;
    if (value < 0.0) {
      low = tried;
      at_low = value;
      if (side == -1) at_high /= 2.0;
      side = -1;
    } else {
      high = tried;
      at_high = value;
      if (side == 1) at_low /= 2.0;
      side = 1;
    }
  }
  return high;
}

}  // namespace o80
