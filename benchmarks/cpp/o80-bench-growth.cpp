// What an iteration, a reader and an attach cost with many actuators, queued commands and rows of
// history, beside the same with few. The backend is stepped in this thread, so that its own work is
// measured. Argument: rounds.

#include "empty_robot.hpp"

namespace o80::bench {
namespace {

Schema robot_of(std::uint32_t actuators) {
  Schema schema;
  const std::uint32_t type = schema.add_type("double", {scalar_field("value", Kind::float64)});
  schema.add_actuators("joint", type, actuators);
  return schema;
}

/// A backend without a driver or a clock of its own, and a frontend that has a lane.
class Bench {
 public:
  Bench(std::uint32_t actuators, std::uint64_t history, std::uint32_t lane_blocks = 16384)
      : backend_(robot_of(actuators), {.segment = segment_name("growth"),
                                       .history = history,
                                       .lanes = 1,
                                       .lane_blocks = lane_blocks}) {
    backend_.publish();
    frontend_ = std::make_unique<UntypedFrontend>(backend_.name());
    frontend_->add_purge();
    frontend_->pulse();
    iterate(100);
  }

  UntypedFrontend& frontend() { return *frontend_; }
  void iterate(std::int64_t n = 1) {
    for (std::int64_t i = 0; i < n; ++i) {
      backend_.step();
      backend_.publish();
    }
  }
  double iteration(std::int64_t n) {
    return nanoseconds([&] { iterate(n); }) / static_cast<double>(n);
  }
  void command(std::uint32_t actuator, Mode mode = Mode::queue) {
    const double target = 1.0;
    frontend_->add_command(actuator, std::as_bytes(std::span(&target, 1)),
                           {.pace = iterations(1'000'000'000), .mode = mode});
  }

 private:
  UntypedBackend backend_;
  std::unique_ptr<UntypedFrontend> frontend_;
};

void growth_sample(const std::string& name, const std::string& size, double value) {
  sample(("growth_" + name + size).c_str(), "ns", value);
}

/// An iteration in which all move, for each of them.
void actuators(std::uint32_t n, const std::string& size) {
  Bench bench(n, 1000);
  for (std::uint32_t i = 0; i < n; ++i) bench.command(i);
  bench.frontend().pulse();
  bench.iterate(100);
  growth_sample("actuators", size, bench.iteration(1000) / n);
}

/// `n` commands wait behind one that runs.
void queued(std::int64_t n, const std::string& size) {
  Bench bench(2, 1000, 1U << 18);
  for (std::int64_t i = 0; i <= n; ++i) bench.command(0);
  const Batch batch = bench.frontend().pulse();
  while (batch.first_iteration() < 0) bench.iterate();  // a bounded number of blocks an iteration
  growth_sample("queued", size, bench.iteration(1000));

  std::vector<double> takes;
  for (int i = 0; i < 51; ++i) {
    bench.command(0);
    bench.frontend().pulse();
    takes.push_back(nanoseconds([&] { bench.iterate(); }));
  }
  growth_sample("taking", size, median(takes));

  bench.command(0, Mode::overwrite);
  bench.frontend().pulse();
  growth_sample("dropping", size, bench.iteration(1));
}

void history(std::int64_t rows, const std::string& size) {
  Bench bench(2, static_cast<std::uint64_t>(rows));
  bench.iterate(rows);
  growth_sample("publish", size, bench.iteration(2000));
  UntypedObservation row(bench.frontend().description());
  growth_sample("latest", size, nanoseconds([&] {
                                  for (int i = 0; i < 1000; ++i)
                                    bench.frontend().latest(row.bytes());
                                }) / 1000);
  const std::string segment = segment_name("growth");
  growth_sample("attach", size, nanoseconds([&] {
                                  for (int i = 0; i < 5; ++i) UntypedFrontend another(segment);
                                }) / 5);
}

void measure(int rounds) {
  take_priority();
  for (int round = 0; round < rounds; ++round) {
    actuators(100, "_few");
    actuators(1000, "");
    queued(1000, "_few");
    queued(100'000, "");
    history(10'000, "_few");
    history(1'000'000, "");
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
