#pragma once

#include <cmath>
#include <cstdint>
#include <random>

namespace o80::test {

/// Random numbers that are the same on every machine, unlike the standard distributions.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}

  std::int64_t whole(std::int64_t low, std::int64_t high) {
    const auto count = static_cast<std::uint64_t>(high - low) + 1;
    return low + static_cast<std::int64_t>(random_() % count);
  }
  double real(double low, double high) {
    return low + (high - low) * (static_cast<double>(random_() >> 11) * 0x1p-53);
  }
  bool one_in(std::int64_t n) { return whole(1, n) == 1; }
  /// Evenly spread in its logarithm.
  double magnitude(double low, double high) {
    return low * std::exp(real(0.0, 1.0) * std::log(high / low));
  }

 private:
  std::mt19937_64 random_;
};

}  // namespace o80::test
