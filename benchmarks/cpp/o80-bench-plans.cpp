// What it costs to start a planned command, and each iteration after that: one number, with the
// 99th percentile of random starts; one number and seven that arrive together beside ruckig.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "benchmarks/cpp/sample.hpp"
#include "control/motion/number_motion.hpp"
#ifdef O80_HAS_RUCKIG
#include <ruckig/ruckig.hpp>
#endif

namespace o80::bench {
namespace {

constexpr int kStarts = 500;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPeriod = 1e-3;  // [s]
constexpr double kSpeed = 2.6;
constexpr double kAcceleration = 10.0;
constexpr double kJerk = 5000.0;

template <std::size_t N>
using Targets = std::array<double, N>;
using Motions = std::vector<NumberMotion>;

/// The command of all of them: the fewest iterations, or `least`.
std::int64_t start(Motions& motions, const double* targets, std::int64_t least = 0) {
  Requested requested;
  requested.iterations = least;
  std::int64_t iterations = 0;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    requested.target = targets[i];
    motions[i].begin();
    iterations = std::max(iterations, motions[i].propose(requested));
  }
  for (NumberMotion& motion : motions) motion.settle(iterations);
  return iterations;
}

/// Starts from rest, or in an iteration of a motion to other targets.
template <std::size_t N>
struct Start {
  Targets<N> first{};
  std::int64_t cut = 0;  // 0: from rest
  Targets<N> target{};
  std::int64_t least = 0;

  Motions before() const {
    const Rates rates{kSpeed * kPeriod, kAcceleration * kPeriod * kPeriod,
                      kJerk * kPeriod * kPeriod * kPeriod};
    Motions motions;
    for (std::size_t i = 0; i < N; ++i) {
      motions.emplace_back(NumberLimiter(-kInfinity, kInfinity, rates), std::nullopt);
      motions.back().restart(0.0);
    }
    if (cut > 0) start(motions, first.data());
    for (std::int64_t k = 0; k < cut; ++k) {
      for (NumberMotion& motion : motions) motion.step(-kInfinity, kInfinity);
    }
    return motions;
  }
};

enum class From { rest, motion, motion_stretched };

template <std::size_t N>
std::vector<Start<N>> draw(From from) {
  std::mt19937_64 random(1);  // NOLINT(bugprone-random-generator-seed)
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  std::vector<Start<N>> starts(kStarts);
  for (Start<N>& one : starts) {
    for (std::size_t i = 0; i < N; ++i) {
      one.first[i] = place(random);
      one.target[i] = place(random);
    }
    if (from != From::rest) one.cut = 1 + static_cast<std::int64_t>(random() % 200);
    if (from != From::motion_stretched) continue;
    Motions motions = one.before();
    const std::int64_t fewest = start(motions, one.target.data());
    one.least = fewest + 1 + static_cast<std::int64_t>(random() % 1'000'000) % fewest;
  }
  return starts;
}

/// Median and 99th percentile of the starts of one number.
void measure_starts(const std::string& name, const std::vector<Start<1>>& starts) {
  std::vector<double> times;
  for (const Start<1>& one : starts) {
    Motions motions = one.before();
    times.push_back(nanoseconds([&] { start(motions, one.target.data(), one.least); }) / 1e3);
  }
  std::sort(times.begin(), times.end());
  sample(name.c_str(), "us", times[times.size() / 2]);
  sample((name + "_p99").c_str(), "us", times[times.size() * 99 / 100]);
}

/// To the end of each motion.
void measure_iterations(const std::vector<Start<1>>& starts) {
  std::vector<double> times;
  for (const Start<1>& one : starts) {
    Motions motions = one.before();
    const std::int64_t iterations = start(motions, one.target.data());
    const double time = nanoseconds([&] {
      for (std::int64_t i = 0; i < iterations; ++i) motions[0].step(-kInfinity, kInfinity);
    });
    times.push_back(time / static_cast<double>(iterations));
  }
  sample("plan_iteration", "ns", median(times));
}

#ifdef O80_HAS_RUCKIG
/// The same starts as calculations of ruckig, each cut out of ruckig's own motion.
template <std::size_t N>
class Ruckig {
 public:
  explicit Ruckig(const std::vector<Start<N>>& starts) {
    for (const Start<N>& one : starts) {
      Input input;
      input.current_position.fill(0.0);
      input.max_velocity.fill(kSpeed);
      input.max_acceleration.fill(kAcceleration);
      input.max_jerk.fill(kJerk);
      if (one.cut > 0) {
        input.target_position = one.first;
        calculator_.calculate(input, trajectory_);
        trajectory_.at_time(static_cast<double>(one.cut) * kPeriod, input.current_position,
                            input.current_velocity, input.current_acceleration);
      }
      input.target_position = one.target;
      inputs_.push_back(input);
    }
  }
  void calculate() {
    for (const Input& input : inputs_) calculator_.calculate(input, trajectory_);
  }

 private:
  using Input = ruckig::InputParameter<N>;
  ruckig::Ruckig<N> calculator_;
  ruckig::Trajectory<N> trajectory_;
  std::vector<Input> inputs_;
};
#endif

/// Means over all starts, in turn: `name` and ruckig_<name>.
template <std::size_t N>
void measure_beside_ruckig(const std::string& name, From from, int rounds) {
  const std::vector<Start<N>> starts = draw<N>(from);
#ifdef O80_HAS_RUCKIG
  Ruckig<N> peer(starts);
#else
  std::printf("ruckig_%s\tskipped\truckig is not installed\n", name.c_str());
#endif
  for (int round = -1; round < rounds; ++round) {  // the first one warms up
    std::vector<Motions> motions;
    for (const Start<N>& one : starts) motions.push_back(one.before());
    const double ours = nanoseconds([&] {
      for (std::size_t i = 0; i < motions.size(); ++i) start(motions[i], starts[i].target.data());
    });
    if (round >= 0) sample(name.c_str(), "us", ours / kStarts / 1e3);
#ifdef O80_HAS_RUCKIG
    const double others = nanoseconds([&] { peer.calculate(); });
    if (round >= 0) sample(("ruckig_" + name).c_str(), "us", others / kStarts / 1e3);
#endif
  }
}

void measure(int rounds) {
  take_priority();
  pin(0);
  const auto from_rest = draw<1>(From::rest);
  const auto moving = draw<1>(From::motion);
  const auto stretched = draw<1>(From::motion_stretched);
  for (int round = 0; round < rounds; ++round) {
    measure_starts("plan_from_rest", from_rest);
    measure_starts("plan_moving", moving);
    measure_starts("plan_stretched", stretched);
    measure_iterations(moving);
  }
  measure_beside_ruckig<1>("start_rest", From::rest, rounds);
  measure_beside_ruckig<1>("start_moving", From::motion, rounds);
  measure_beside_ruckig<7>("start_7_moving", From::motion, rounds);
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
