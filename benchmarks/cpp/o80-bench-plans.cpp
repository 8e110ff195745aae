// What it costs to start a planned command for one number, and each iteration after that. Of the
// random starts a round gives the median and, beside it, the 99th percentile.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "benchmarks/cpp/sample.hpp"
#include "control/number_motion.hpp"

namespace o80::bench {
namespace {

constexpr int kStarts = 2000;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Limits of one number, in seconds.
struct Joint {
  double speed;
  double acceleration;
  double jerk;
  double frequency;

  NumberMotion at_rest() const {
    const double t = 1.0 / frequency;
    NumberMotion motion(
        NumberLimiter(-kInfinity, kInfinity, {speed * t, acceleration * t * t, jerk * t * t * t}),
        std::nullopt);
    motion.restart(0.0);
    return motion;
  }
};

constexpr Joint kJoints[] = {{2.0, 15.0, 500.0, 500.0}, {2.6, 10.0, 5000.0, 1000.0}};

/// A command that is about to start.
struct Begun {
  NumberMotion motion;
  NumberMotion::Asked asked;

  std::int64_t start() {
    motion.begin();
    const std::int64_t iterations = motion.propose(asked);
    motion.settle(iterations);
    return iterations;
  }
};

class Draw {
 public:
  Begun at_rest() {
    Begun one{kJoints[random_() % 2].at_rest(), {}};
    one.asked.target = real(-1.0, 1.0);
    return one;
  }
  /// From any iteration of another motion.
  Begun moving() {
    Begun one = at_rest();
    const std::int64_t iterations = one.start();
    const auto cut = static_cast<std::int64_t>(real(0.0, 1.0) * static_cast<double>(iterations));
    for (std::int64_t i = 0; i < cut; ++i) one.motion.step(-kInfinity, kInfinity);
    one.asked.target = one.motion.position() + real(-1.0, 1.0);
    return one;
  }
  /// In up to twice the fewest iterations.
  Begun stretched() {
    Begun one = moving();
    const std::int64_t fewest = Begun(one).start();
    one.asked.iterations =
        fewest + 1 + static_cast<std::int64_t>(real(0.0, 1.0) * static_cast<double>(fewest));
    return one;
  }

 private:
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::mt19937_64 random_{1};  // NOLINT(bugprone-random-generator-seed)
};

template <class One>
std::vector<Begun> many(One&& one) {
  std::vector<Begun> all;
  for (int i = 0; i < kStarts; ++i) all.push_back(one());
  return all;
}

void measure_starts(const std::string& name, const std::vector<Begun>& starts) {
  std::vector<double> times;
  for (const Begun& each : starts) {
    Begun one = each;
    times.push_back(nanoseconds([&] { one.start(); }) / 1e3);
  }
  std::sort(times.begin(), times.end());
  sample(name.c_str(), "us", times[times.size() / 2]);
  sample((name + "_p99").c_str(), "us", times[times.size() * 99 / 100]);
}

/// To the end of each motion.
void measure_iterations(const std::vector<Begun>& starts) {
  double time = 0.0;
  std::int64_t steps = 0;
  for (const Begun& each : starts) {
    Begun one = each;
    const std::int64_t iterations = one.start();
    steps += iterations;
    time += nanoseconds([&] {
      for (std::int64_t i = 0; i < iterations; ++i) one.motion.step(-kInfinity, kInfinity);
    });
  }
  sample("plan_iteration", "ns", time / static_cast<double>(steps));
}

void measure(int rounds) {
  take_priority();
  pin(0);
  Draw draw;
  const std::vector<Begun> from_rest = many([&] { return draw.at_rest(); });
  const std::vector<Begun> moving = many([&] { return draw.moving(); });
  const std::vector<Begun> stretched = many([&] { return draw.stretched(); });
  for (int round = 0; round < rounds; ++round) {
    measure_starts("plan_from_rest", from_rest);
    measure_starts("plan_moving", moving);
    measure_starts("plan_stretched", stretched);
    measure_iterations(moving);
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
