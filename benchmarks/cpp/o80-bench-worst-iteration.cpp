// The longest iteration under each of the heaviest loads, in processor time of the thread of the
// loop, which no busy machine blurs. Arguments: rounds (5 at most are made); the best round counts,
// because only the work is the backend's own.

#include <time.h>

#include <algorithm>
#include <cstdio>
#include <memory>
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
  while (robot.backend.iteration() < flood::kAt + 300) {
    const double begin = thread_microseconds();
    robot.iterate();
    times.push_back(thread_microseconds() - begin);
  }
  return times;
}

/// The same script has the same work in its i-th iteration: what one round needed more was the
/// machine's.
double worst_of(const flood::Load& load, std::uint32_t actuators, int rounds) {
  std::vector<double> best = iterations_of(load, actuators);
  for (int i = 1; i < rounds; ++i) {
    const std::vector<double> again = iterations_of(load, actuators);
    const std::size_t count = std::min(best.size(), again.size());
    best.resize(count);
    for (std::size_t k = 0; k < count; ++k) best[k] = std::min(best[k], again[k]);
  }
  return *std::max_element(best.begin(), best.end());
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = std::min(bench::rounds_of(argc, argv), 5);
  bench::take_priority();
  for (const std::uint32_t actuators : {8U, 64U}) {
    double worst = 0;
    for (const flood::Load& load : flood::heaviest_loads()) {
      const double time = worst_of(load, actuators, rounds);
      worst = std::max(worst, time);
      std::fprintf(stderr, "%2u actuators  %9.1f us  %s\n", actuators, time, load.name);
    }
    bench::sample(actuators == 8 ? "worst_iteration_8" : "worst_iteration_64", "us", worst);
  }
}
