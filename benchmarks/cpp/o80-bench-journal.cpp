// What the journal costs an iteration that takes a batch of eight commands: the same backend with
// and without a journal, in turn, iteration by iteration.

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <numeric>
#include <span>

#include "o80/o80.hpp"
#include "o80/runtime/robot_types.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr std::size_t kIterations = 20'000;  // of a sample
constexpr std::uint32_t kActuators = 8;

struct Eight {
  using Actuators = std::array<double, kActuators>;
};

Schema schema_of_eight() {
  Schema schema;
  schema.head.robot = NameText("eight");
  describe_types<Eight>(schema);
  return schema;
}

/// A backend and a commander in one thread.
class Pair {
 public:
  Pair(const std::string& name, std::int64_t journal)
      : backend_(schema_of_eight(), {.segment = name, .history = 1000, .journal = journal}) {
    backend_.publish();
    frontend_ = std::make_unique<UntypedFrontend>(name);
  }

  /// One iteration that takes a command for each actuator [ns].
  std::int64_t iterate() {
    ++target_;
    for (std::uint32_t i = 0; i < kActuators; ++i) {
      frontend_->add_command(i, std::as_bytes(std::span(&target_, 1)));
    }
    frontend_->pulse();
    const std::int64_t begin = monotonic_now();
    backend_.try_step();
    backend_.publish();
    return monotonic_now() - begin;
  }

 private:
  UntypedBackend backend_;
  std::unique_ptr<UntypedFrontend> frontend_;
  double target_ = 0;
};

/// What two readings of the clock cost; a part of each measured iteration.
double clock_cost() {
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < 100'000; ++i) {
    const std::int64_t begin = monotonic_now();
    least = std::min(least, monotonic_now() - begin);
  }
  return static_cast<double>(least);
}

/// Mean of the faster half of the times: without iterations that something else has delayed, and
/// finer than the clock, which counts in steps of about 10 ns.
double quiet_mean(std::vector<double> times) {
  const auto half = static_cast<std::ptrdiff_t>(times.size() / 2);
  std::nth_element(times.begin(), times.begin() + half, times.end());
  return std::accumulate(times.begin(), times.begin() + half, 0.0) / static_cast<double>(half);
}

void measure(int rounds) {
  take_priority();
  pin(0);
  // two of each, in turn: where its memory lies makes a backend up to 1 % faster or slower
  std::array<std::unique_ptr<Pair>, 4> pairs;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const bool has_journal = i == 0 || i == 3;
    pairs[i] = std::make_unique<Pair>(segment_name(std::to_string(i)), has_journal ? -1 : 0);
  }
  const double clock = clock_cost();
  for (int round = -1; round < rounds; ++round) {
    std::array<std::vector<double>, 2> times;
    for (std::size_t i = 0; i < kIterations; ++i) {
      const std::size_t which = i % pairs.size();
      const bool has_journal = which == 0 || which == 3;
      times[has_journal ? 0 : 1].push_back(static_cast<double>(pairs[which]->iterate()) - clock);
    }
    if (round < 0) continue;  // warms up
    sample("iteration_with_journal", "ns", quiet_mean(times[0]));
    sample("iteration_without_journal", "ns", quiet_mean(times[1]));
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
