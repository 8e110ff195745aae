// Commands both joints of the segment 'watched' until its backend ends in order; then prints how
// many commands were completed, the overruns, and a line "lateness [us] iterations" for each
// lateness that was met.

#include <cstdio>
#include <map>

#include "o80/o80.hpp"

using namespace std::chrono_literals;

namespace {

/// Movements that overwrite, queue and wait, for ever. Returns when the backend has stopped.
long command_until_the_end(o80::UntypedFrontend& frontend) {
  long batches = 0;
  try {
    for (double target = 0.0;; target = target < 1.0 ? target + 0.125 : -1.0) {
      const auto bytes = std::as_bytes(std::span(&target, 1));
      frontend.add_command(0, bytes, {.pace = o80::iterations(4)});
      frontend.add_command(1, bytes, {.pace = o80::iterations(9), .mode = o80::Mode::overwrite});
      frontend.add_command(1, bytes, {.pace = o80::iterations(3)});
      frontend.pulse_and_wait(60s);
      ++batches;
    }
  } catch (const o80::BackendStopped&) {
    return batches;
  }
}

}  // namespace

int main() try {
  o80::UntypedFrontend frontend("watched", {.timeout = 60s});
  const long batches = command_until_the_end(frontend);

  std::map<long long, long> histogram;
  o80::RowHead head;
  const o80::Rows rows = frontend.history(1'000'000);
  for (std::size_t i = 0; i < rows.count; ++i) {
    head = o80::unpack<o80::RowHead>(rows.row(i).data());
    if (head.iteration > 0) ++histogram[head.lateness / 1000];
  }
  std::printf("frontend: batches=%ld overruns=%u skipped=%u\n", batches, head.overruns,
              head.skipped);
  for (const auto& [lateness, iterations] : histogram) {
    std::printf("lateness %lld %ld\n", lateness, iterations);
  }
  return 0;
} catch (const o80::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
