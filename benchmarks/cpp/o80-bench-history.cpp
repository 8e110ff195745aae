// Ten thousand rows out of the segment, beside memcpy of the same bytes.

#include <cstring>

#include "empty_robot.hpp"
#include "runtime/frontend/link.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr std::size_t kRows = 10'000;
constexpr int kWarmUps = 5;  // pages are touched, processors awake

double gigabytes_per_second(std::size_t bytes, double time) {
  return static_cast<double>(bytes) / time;
}

template <Driver D>
void measure_rows(const char* reading, const char* copying, int rounds) {
  const std::string name = segment_name("history");
  const Running<D> robot(name, 1);
  pin(0);
  UntypedFrontend frontend(name);
  frontend.burst(kRows + 10, std::chrono::seconds(20));
  const std::size_t bytes = kRows * frontend.layout().size;
  std::vector<std::byte> from(bytes, std::byte{1});
  std::vector<std::byte> to(bytes);

  for (int round = -kWarmUps; round < rounds; ++round) {
    std::memcpy(to.data(), from.data(), bytes);
    const double copied = nanoseconds([&] { std::memcpy(to.data(), from.data(), bytes); });
    HistoryReader::Range range{};
    const double read = nanoseconds([&] {
      const HistoryReader& history = frontend.link()->history;
      range = history.read_range(history.published() - (kRows - 1), kRows, to.data());
    });
    if (range.count != kRows) std::abort();
    if (round < 0) continue;
    sample(copying, "GB/s", gigabytes_per_second(bytes, copied));
    sample(reading, "GB/s", gigabytes_per_second(bytes, read));
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) {
  o80::bench::take_priority();
  const int rounds = o80::bench::rounds_of(argc, argv);
  o80::bench::measure_rows<o80::bench::TwoEmpty>("history_small_rows", "memcpy_small_rows", rounds);
  o80::bench::measure_rows<o80::bench::EightWithSensors>("history_large_rows", "memcpy_large_rows",
                                                         rounds);
}
