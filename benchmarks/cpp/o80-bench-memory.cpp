// What a robot of eight actuators with a history of 1e5 rows takes, beside its payload.

#include <sys/stat.h>

#include <fstream>
#include <sstream>
#include <string>

#include "empty_robot.hpp"
#include "o80/memory/segment_name.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr std::uint64_t kRows = 100'000;
constexpr double kMegabyte = 1e6;

struct Eight {
  using Actuators = std::array<double, 8>;
};

/// What the pages of this process take, those it shares counted in part [B].
struct Resident {
  double segment = 0;  // mapped from the given file, however often; 0: from none
  double rest = 0;
};

Resident resident(ino_t file) {
  Resident sum;
  std::ifstream maps("/proc/self/smaps");
  bool ours = false;
  for (std::string line; std::getline(maps, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (!word.ends_with(':')) {
      // a mapping begins: addresses, permissions, offset, device, file
      std::string passed;
      ino_t mapped = 0;
      words >> passed >> passed >> passed >> mapped;
      ours = mapped == file;
    } else if (double kibibytes = 0; word == "Pss:" && words >> kibibytes) {
      (ours ? sum.segment : sum.rest) += kibibytes * 1024;
    }
  }
  return sum;
}

void measure() {
  const std::string name = segment_name("memory");
  const auto [anonymous, files] = resident(0);
  Backend<Eight> backend({.segment = name, .history = kRows});
  for (std::uint64_t i = 0; i < kRows + 10; ++i) {
    if (i > 0) backend.step();
    backend.publish({});
  }
  // a frontend that has read all there is and holds a lane
  UntypedFrontend frontend(name);
  UntypedObservation row(frontend.description());
  const Iteration last = frontend.published();
  for (Iteration k = frontend.oldest(); k <= last; ++k) frontend.wait_for(k, row.bytes(), {});
  frontend.add_purge();
  frontend.pulse();
  backend.step();
  backend.publish({});

  struct stat file{};
  stat(segment_path(name).c_str(), &file);
  const BackendOptions defaults;
  const double rows = static_cast<double>(kRows) * frontend.layout().size;
  const double lanes =
      static_cast<double>(std::uint64_t{defaults.lanes} * defaults.lane_blocks * kBlockBytes);
  sample("payload", "MB", (rows + lanes) / kMegabyte);
  sample("reserved", "MB", static_cast<double>(file.st_blocks) * 512 / kMegabyte);
  const Resident after = resident(file.st_ino);
  sample("resident", "MB", after.segment / kMegabyte);
  // beside the segment: the pool in which queued commands lie, as large as the lanes, and the rest
  sample("private", "MB", (after.rest - anonymous - files) / kMegabyte);
}

}  // namespace
}  // namespace o80::bench

int main() { o80::bench::measure(); }
