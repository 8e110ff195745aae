// What the journal costs an iteration that takes a batch of eight commands: the same backend with
// and without a journal, in turn.

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <span>

#include "o80/o80.hpp"
#include "o80/runtime/robot_types.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr int kIterations = 5000;  // of a sample
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

void measure(int rounds) {
  take_priority();
  pin(0);
  Pair with(segment_name("with"), -1);
  Pair without(segment_name("without"), 0);
  const double clock = clock_cost();
  for (int round = -1; round < rounds; ++round) {
    std::array<std::vector<double>, 2> times;
    // in turn, so that both see the same machine
    for (int i = 0; i < kIterations; ++i) {
      times[0].push_back(static_cast<double>(with.iterate()) - clock);
      times[1].push_back(static_cast<double>(without.iterate()) - clock);
    }
    if (round < 0) continue;  // warms up
    sample("iteration_with_journal", "ns", median(times[0]));
    sample("iteration_without_journal", "ns", median(times[1]));
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
