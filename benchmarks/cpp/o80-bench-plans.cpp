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
#include "control/motion/number_motion.hpp"

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

std::int64_t start(NumberMotion& motion, double target, std::int64_t least = 0) {
  Requested requested;
  requested.target = target;
  requested.iterations = least;
  motion.begin();
  const std::int64_t iterations = motion.propose(requested);
  motion.settle(iterations);
  return iterations;
}

/// A command that starts from rest, or in an iteration of another one.
struct Start {
  Joint joint;
  double first = 0.0;    // target of the other one
  std::int64_t cut = 0;  // the iteration; 0: from rest
  double target = 0.0;
  std::int64_t requested = 0;

  NumberMotion before() const {
    NumberMotion motion = joint.at_rest();
    if (cut > 0) start(motion, first);
    for (std::int64_t i = 0; i < cut; ++i) motion.step(-kInfinity, kInfinity);
    return motion;
  }
};

class Draw {
 public:
  Start at_rest() { return {.joint = kJoints[random_() % 2], .target = real(-1.0, 1.0)}; }
  Start moving() {
    Start one = at_rest();
    one.first = real(-1.0, 1.0);
    NumberMotion motion = one.joint.at_rest();
    one.cut = 1 + some_of(start(motion, one.first));
    one.target += one.before().position();
    return one;
  }
  /// In up to twice the fewest iterations.
  Start stretched() {
    Start one = moving();
    NumberMotion motion = one.before();
    const std::int64_t fewest = start(motion, one.target);
    one.requested = fewest + 1 + some_of(fewest);
    return one;
  }

 private:
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  std::int64_t some_of(std::int64_t iterations) {
    return static_cast<std::int64_t>(real(0.0, 1.0) * static_cast<double>(iterations));
  }
  std::mt19937_64 random_{1};  // NOLINT(bugprone-random-generator-seed)
};

template <class One>
std::vector<Start> many(One&& one) {
  std::vector<Start> all(kStarts);
  std::generate(all.begin(), all.end(), one);
  return all;
}

void measure_starts(const std::string& name, const std::vector<Start>& starts) {
  std::vector<double> times;
  for (const Start& each : starts) {
    NumberMotion motion = each.before();
    times.push_back(nanoseconds([&] { start(motion, each.target, each.requested); }) / 1e3);
  }
  std::sort(times.begin(), times.end());
  sample(name.c_str(), "us", times[times.size() / 2]);
  sample((name + "_p99").c_str(), "us", times[times.size() * 99 / 100]);
}

/// To the end of each motion.
void measure_iterations(const std::vector<Start>& starts) {
  std::vector<double> times;
  for (const Start& each : starts) {
    NumberMotion motion = each.before();
    const std::int64_t iterations = start(motion, each.target, each.requested);
    const double time = nanoseconds([&] {
      for (std::int64_t i = 0; i < iterations; ++i) motion.step(-kInfinity, kInfinity);
    });
    times.push_back(time / static_cast<double>(iterations));
  }
  sample("plan_iteration", "ns", median(times));
}

void measure(int rounds) {
  take_priority();
  pin(0);
  Draw draw;
  const std::vector<Start> from_rest = many([&] { return draw.at_rest(); });
  const std::vector<Start> moving = many([&] { return draw.moving(); });
  const std::vector<Start> stretched = many([&] { return draw.stretched(); });
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
