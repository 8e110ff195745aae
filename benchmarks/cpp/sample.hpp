#pragma once

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "o80/base/time.hpp"

namespace o80::bench {

/// How often each measurement is repeated, alternating with its baseline: the first argument.
inline int rounds_of(int argc, char** argv) { return argc > 1 ? std::atoi(argv[1]) : 15; }

/// One sample, on a line: name, unit, value. The Python side takes medians over the rounds.
inline void sample(const char* name, const char* unit, double value) {
  std::printf("%s\t%s\t%.9g\n", name, unit, value);
}

/// Keeps ordinary processes of this machine out of short measurements, where that is allowed; the
/// threads started from here on inherit it.
inline void take_priority() {
  const sched_param priority{.sched_priority = 20};
  sched_setscheduler(0, SCHED_RR, &priority);
}

/// Keeps the calling thread on one processor.
inline void pin(int processor) {
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(processor, &one);
  sched_setaffinity(0, sizeof one, &one);
}

/// Time a call takes [ns].
template <class Call>
double nanoseconds(Call&& call) {
  const std::int64_t begin = monotonic_now();
  call();
  return static_cast<double>(monotonic_now() - begin);
}

inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// A segment name that no other run uses.
inline std::string segment_name(const std::string& what) {
  return "bench-" + what + "-" + std::to_string(getpid());
}

}  // namespace o80::bench
