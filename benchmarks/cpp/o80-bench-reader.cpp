// One reader of a running backend, in a process of its own: waits for each row in order and reads
// the newest as well, until the backend ends. Argument: segment.

#include <signal.h>
#include <sys/prctl.h>

#include <chrono>
#include <cstddef>
#include <vector>

#include "o80/o80.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  // it never outlives who started it
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const o80::UntypedFrontend frontend(argv[1]);
  std::vector<std::byte> row(frontend.layout().size);
  o80::Iteration position = frontend.published() + 1;
  try {
    while (true) {
      frontend.wait_for_next(position, row.data(), std::chrono::minutes(1));
      frontend.latest(row.data());
    }
  } catch (const o80::BackendGone&) {
    return 0;
  }
}
