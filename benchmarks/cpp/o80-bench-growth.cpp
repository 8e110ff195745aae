// What things cost as robots, queues, histories, bursts and readers grow.
//
// A line a sample: curve, unit, size, value. The backend is stepped in this thread, so that what
// grows is its own work; nothing waits for another thread but in the curves of readers.

#include <sys/wait.h>

#include <csignal>
#include <cstring>

#include "empty_robot.hpp"
#include "runtime/link.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

void point(const char* curve, const char* unit, std::int64_t size, double value) {
  std::printf("%s\t%s\t%lld\t%.9g\n", curve, unit, static_cast<long long>(size), value);
  std::fflush(stdout);
}

Schema robot_of(std::uint32_t actuators) {
  Schema schema;
  const std::uint32_t type = schema.add_type("double", {scalar_field("value", Kind::float64)});
  schema.add_actuators("joint", type, actuators);
  return schema;
}

/// A backend without a driver or a clock of its own, and a frontend of it.
class Bench {
 public:
  Bench(std::uint32_t actuators, std::uint64_t history, std::uint32_t lane_blocks = 16384,
        std::uint32_t lanes = 1)
      : backend_(robot_of(actuators), {.segment = segment_name("growth"),
                                       .history = history,
                                       .lanes = lanes,
                                       .lane_blocks = lane_blocks}) {
    backend_.publish();
    frontend_ = std::make_unique<UntypedFrontend>(backend_.name());
  }

  UntypedBackend& backend() { return backend_; }
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
  /// With the first pulse, which is not what is measured.
  void take_lane() {
    frontend_->add_purge();
    frontend_->pulse();
  }
  void command(std::uint32_t actuator, const CommandOptions& options) {
    const double target = 1.0;
    frontend_->add_command(actuator, std::as_bytes(std::span(&target, 1)), options);
  }

 private:
  UntypedBackend backend_;
  std::unique_ptr<UntypedFrontend> frontend_;
};

CommandOptions for_long(Mode mode = Mode::queue) {
  return {.pace = iterations(1'000'000'000), .mode = mode};
}

void actuators(std::uint32_t n) {
  Bench bench(n, 1000);
  bench.take_lane();
  bench.iterate(100);
  point("iteration, at rest", "ns", n, bench.iteration(1000));
  for (std::uint32_t i = 0; i < n; ++i) bench.command(i, for_long());
  point("pulse, one command each", "ns", n, nanoseconds([&] { bench.frontend().pulse(); }));
  bench.iterate(100);
  point("iteration, all moving", "ns", n, bench.iteration(1000));
}

/// `n` commands wait behind one that runs.
void queued(std::int64_t n) {
  Bench bench(2, 1000, 1U << 18);
  bench.take_lane();
  bench.iterate(10);
  for (std::int64_t i = 0; i <= n; ++i) bench.command(0, for_long());
  Batch batch;
  const double pulse = nanoseconds([&] { batch = bench.frontend().pulse(); });
  // a bounded number of blocks an iteration
  const double taking = nanoseconds([&] {
    while (batch.first_iteration() < 0) bench.iterate();
  });
  if (n > 0) point("pulse of n commands", "ns", n, pulse);
  if (n >= 1000) point("taking n commands", "ns", n, taking);
  point("iteration, n queued", "ns", std::max<std::int64_t>(n, 1), bench.iteration(1000));

  std::vector<double> pulses;
  std::vector<double> takes;
  for (int i = 0; i < 51; ++i) {
    bench.command(0, for_long());
    pulses.push_back(nanoseconds([&] { bench.frontend().pulse(); }));
    takes.push_back(nanoseconds([&] { bench.iterate(); }));
  }
  point("pulse of one more", "ns", std::max<std::int64_t>(n, 1), median(pulses));
  point("iteration that takes one more", "ns", std::max<std::int64_t>(n, 1), median(takes));
  bench.command(0, for_long(Mode::overwrite));
  bench.frontend().pulse();
  // it tells the ends of 1024, the others follow, as many an iteration
  const double dropping = bench.iteration(1);
  if (n >= 1000) point("iteration that drops n", "ns", n, dropping);
  double told = 0;
  std::int64_t told_in = 0;
  for (; told_in < n / 1024 + 2; ++told_in) told += bench.iteration(1);
  if (n >= 1000) point("telling the ends of n", "ns", n, told);
}

void history(std::int64_t rows) {
  Bench bench(2, static_cast<std::uint64_t>(rows));
  bench.iterate(std::min<std::int64_t>(rows + 100, 1'100'000));
  point("publish, history of n", "ns", rows, bench.iteration(2000));
  UntypedObservation row(bench.frontend().description());
  point("latest, history of n", "ns", rows, nanoseconds([&] {
                                              for (int i = 0; i < 1000; ++i)
                                                bench.frontend().latest(row.bytes());
                                            }) / 1000);
  const std::size_t some = 100;
  point("100 rows, history of n", "ns", rows, nanoseconds([&] {
                                                for (int i = 0; i < 20; ++i)
                                                  static_cast<void>(bench.frontend().history(some));
                                              }) / 20);
  const std::string name = bench.backend().name();
  point("attach, history of n", "ns", rows, nanoseconds([&] {
                                              for (int i = 0; i < 5; ++i)
                                                UntypedFrontend another(name);
                                            }) / 5);
  // beside a plain copy of the same bytes: larger ones leave the caches, whoever copies them
  std::vector<std::byte> from(static_cast<std::size_t>(rows) * row.size(), std::byte{1});
  std::vector<std::byte> to(from.size(), std::byte{2});
  const HistoryReader& reader = bench.frontend().link()->history;
  const Iteration oldest = bench.frontend().oldest();
  std::vector<double> ratios;
  for (int i = 0; i < 5; ++i) {
    const double copying = nanoseconds([&] {
      std::memcpy(to.data(), from.data(), to.size());
      asm volatile("" : : "r"(to.data()) : "memory");
    });
    const double reading =
        nanoseconds([&] { reader.read_range(oldest, static_cast<std::size_t>(rows), to.data()); });
    ratios.push_back(reading / copying);
  }
  point("reading n rows", "memcpy", rows, median(ratios));
}

void bursts(int rounds) {
  const std::string name = segment_name("growth-burst");
  const auto robot = std::make_shared<InlineRobot>(
      std::make_unique<DriverInstance>(*robot_table<TwoEmpty>("empty"), OptionValues{}),
      BackendOptions{.segment = name, .bursting = true, .history = 1000});
  UntypedFrontend frontend(name, robot);
  const auto patience = std::chrono::seconds(20);
  for (int round = 0; round < rounds; ++round) {
    for (const std::int64_t n : {1, 3, 10, 30, 100, 300, 1000, 3000, 10'000, 30'000, 100'000}) {
      const int times = static_cast<int>(std::max<std::int64_t>(1, 2000 / n));
      point("burst(n)", "ns", n, nanoseconds([&] {
                                   for (int i = 0; i < times; ++i) frontend.burst(n, patience);
                                 }) / times);
    }
  }
}

/// So many processes, each reading the newest row a thousand times a second.
void readers(int n) {
  const std::string name = segment_name("growth");
  std::vector<pid_t> pids;
  Bench bench(8, 1000);
  for (int i = 0; i < n; ++i) {
    const pid_t pid = fork();
    if (pid == 0) {
      pin(0);
      const UntypedFrontend frontend(name.substr(0, name.rfind('-') + 1) +
                                     std::to_string(getppid()));
      UntypedObservation row(frontend.description());
      while (getppid() != 1) {
        frontend.latest(row.bytes());
        const timespec pause{.tv_sec = 0, .tv_nsec = 1'000'000};
        nanosleep(&pause, nullptr);
      }
      _exit(0);
    }
    pids.push_back(pid);
  }
  bench.iterate(20'000);
  std::vector<double> taken;
  for (int i = 0; i < 200; ++i) taken.push_back(bench.iteration(5000));
  point("iteration, n readers", "ns", std::max(n, 1), median(taken));
  for (const pid_t pid : pids) kill(pid, SIGKILL);
  for (const pid_t pid : pids) waitpid(pid, nullptr, 0);
}

void measure(int rounds) {
  take_priority();
  pin(1);
  for (int round = 0; round < rounds; ++round) {
    for (const std::uint32_t n : {1, 3, 10, 30, 100, 300, 1000}) actuators(n);
    for (const std::int64_t n : {0, 10, 100, 1000, 10'000, 30'000, 100'000}) queued(n);
    for (const std::int64_t n : {100, 1000, 10'000, 100'000, 1'000'000}) history(n);
    for (const int n : {0, 4, 16, 64}) readers(n);
  }
  bursts(rounds);
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
