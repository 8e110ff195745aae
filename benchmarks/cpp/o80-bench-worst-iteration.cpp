// The longest iteration under each of the heaviest loads, in processor time of the thread of the
// loop, which no busy machine blurs. Arguments: rounds (5 at most are made); the best round counts,
// because only the work is the backend's own.

#include <time.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "benchmarks/cpp/flooded_backend.hpp"
#include "benchmarks/cpp/sample.hpp"

namespace {

using namespace o80;

double thread_microseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e6 + static_cast<double>(now.tv_nsec) / 1e3;
}

/// Steps the robot up to an iteration; adds how long each step takes [us].
void time_until(flood::Robot& robot, Iteration end, std::vector<double>& times) {
  while (robot.backend.iteration() < end) {
    const double begin = thread_microseconds();
    robot.iterate();
    times.push_back(thread_microseconds() - begin);
  }
}

/// Of one run of a load, each of its iterations [us].
std::vector<double> iterations_of(const flood::Load& load, std::uint32_t actuators) {
  const std::string name = bench::segment_name("worst");
  flood::Robot robot(name, actuators);
  std::vector<std::unique_ptr<flood::Sender>> senders;
  for (std::uint32_t i = 0; i < load.senders; ++i) {
    senders.push_back(std::make_unique<flood::Sender>(name));
  }
  for (int i = 0; i < 100; ++i) robot.iterate();
  for (const auto& sender : senders) load.fill(*sender, actuators, flood::kAt);
  std::vector<double> times;
  time_until(robot, flood::kAt + 300, times);
  return times;
}

/// Of a run in which moving numbers get random targets at once, as single commands or in one that
/// stretches all but the slowest of them.
std::vector<double> iterations_of_plans(std::uint32_t actuators, bool together) {
  const std::string name = bench::segment_name("worst");
  flood::Robot robot(name, actuators, 4096, {.speed = 2.6, .acceleration = 10.0, .jerk = 5000.0});
  flood::Sender sender(name);
  std::mt19937_64 random(1);  // NOLINT(bugprone-random-generator-seed)
  std::uniform_real_distribution<double> place(-1.0, 1.0);
  std::vector<double> targets(actuators);
  std::vector<double> times;
  for (int start = 1; start <= 40; ++start) {
    std::vector<BatchBuilder::Member> all;
    for (std::uint32_t i = 0; i < actuators; ++i) {
      targets[i] = place(random);
      RecordHead head;
      head.mode = Mode::overwrite;
      head.pace = Pace::fastest;
      head.actuator = static_cast<std::uint16_t>(i);
      all.push_back({head, {}, std::as_bytes(std::span(&targets[i], 1))});
    }
    if (together) {
      sender.batch.group(all);
    } else {
      for (const auto& one : all) sender.batch.command(one.head, one.states);
    }
    sender.send();
    time_until(robot, 50 * start, times);
  }
  return times;
}

/// The longest iteration of a script that has the same work in its i-th iteration in each run:
/// what one run needed more was the machine's.
template <class Run>
double worst_of(int rounds, Run&& run) {
  std::vector<double> best = run();
  for (int i = 1; i < rounds; ++i) {
    const std::vector<double> again = run();
    const std::size_t count = std::min(best.size(), again.size());
    best.resize(count);
    for (std::size_t k = 0; k < count; ++k) best[k] = std::min(best[k], again[k]);
  }
  return *std::max_element(best.begin(), best.end());
}

void report(std::uint32_t actuators, double time, const char* load) {
  std::fprintf(stderr, "%2u actuators  %9.1f us  %s\n", actuators, time, load);
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = std::min(bench::rounds_of(argc, argv), 5);
  bench::take_priority();
  for (const std::uint32_t actuators : {8U, 64U}) {
    double worst = 0;
    for (const flood::Load& load : flood::heaviest_loads()) {
      const double time = worst_of(rounds, [&] { return iterations_of(load, actuators); });
      worst = std::max(worst, time);
      report(actuators, time, load.name);
    }
    bench::sample(actuators == 8 ? "worst_iteration_8" : "worst_iteration_64", "us", worst);
  }
  const double alone = worst_of(rounds, [] { return iterations_of_plans(64, false); });
  const double together = worst_of(rounds, [] { return iterations_of_plans(64, true); });
  report(64, alone, "plans from motion");
  report(64, together, "the same, stretched to arrive together");
  bench::sample("worst_iteration_plans", "us", std::max(alone, together));
}
