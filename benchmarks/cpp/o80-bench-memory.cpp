// What a robot of eight actuators with a history of 1e5 rows takes, beside its payload.

#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "control/batch/record.hpp"
#include "empty_robot.hpp"
#include "memory/segment/segment_name.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr std::uint64_t kRows = 100'000;
constexpr double kMegabyte = 1e6;

struct Eight {
  using Actuators = std::array<double, 8>;
};

/// What the files of a segment take, its own and the commanders'.
struct Reserved {
  std::set<ino_t> files;
  double bytes = 0;
};

Reserved reserved(const std::string& name) {
  Reserved sum;
  const std::filesystem::path own = segment_path(name);
  for (const auto& entry : std::filesystem::directory_iterator(own.parent_path())) {
    const std::string each = entry.path().filename();
    const std::string commanders = own.filename().string() + ".commanders-";
    if (entry.path() != own && !each.starts_with(commanders)) continue;
    struct stat file{};
    stat(entry.path().c_str(), &file);
    sum.files.insert(file.st_ino);
    sum.bytes += static_cast<double>(file.st_blocks) * 512;
  }
  return sum;
}

/// What the pages of this process take, those it shares counted in part [B].
struct Resident {
  double segment = 0;  // mapped from the given files, however often; 0: from none
  double rest = 0;
};

Resident resident(const std::set<ino_t>& files) {
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
      ours = files.contains(mapped);
    } else if (double kibibytes = 0; word == "Pss:" && words >> kibibytes) {
      (ours ? sum.segment : sum.rest) += kibibytes * 1024;
    }
  }
  return sum;
}

void measure() {
  const std::string name = segment_name("memory");
  const auto [anonymous, files] = resident({0});
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

  const Reserved both = reserved(name);
  const BackendOptions defaults;
  const double rows = static_cast<double>(kRows) * frontend.layout().size;
  const double lanes =
      static_cast<double>(std::uint64_t{defaults.lanes} * defaults.lane_blocks * kBlockBytes);
  sample("payload", "MB", (rows + lanes) / kMegabyte);
  sample("reserved", "MB", both.bytes / kMegabyte);
  const Resident after = resident(both.files);
  sample("resident", "MB", after.segment / kMegabyte);
  // beside the segment: the pool in which queued commands lie, as large as the lanes, and the rest
  sample("private", "MB", (after.rest - anonymous - files) / kMegabyte);
}

}  // namespace
}  // namespace o80::bench

int main() { o80::bench::measure(); }
