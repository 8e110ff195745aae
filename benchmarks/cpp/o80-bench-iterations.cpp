// What one iteration costs: of an empty robot, of eight actuators in motion, and with readers.

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "empty_robot.hpp"
#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr int kBurst = 20'000;
constexpr auto kPatience = std::chrono::seconds(20);

double per_iteration(UntypedFrontend& frontend) {
  return nanoseconds([&] { frontend.burst(kBurst, kPatience); }) / kBurst;
}

/// Commands that last longer than everything measured here.
void set_in_motion(Frontend<EightWithSensors>& frontend) {
  for (std::uint32_t i = 0; i < 8; ++i) {
    frontend.add_command(i, 1.0 + i, {.pace = iterations(2'000'000'000), .mode = Mode::overwrite});
  }
  frontend.pulse();
}

void measure(int rounds) {
  take_priority();
  const std::string two_name = segment_name("two");
  const std::string eight_name = segment_name("eight");
  const Running<TwoEmpty> two(two_name, 1);
  const Running<EightWithSensors> eight(eight_name, 1);
  pin(0);
  Frontend<TwoEmpty> frontend_of_two(two_name);
  Frontend<EightWithSensors> frontend_of_eight(eight_name);
  set_in_motion(frontend_of_eight);
  per_iteration(frontend_of_two);
  per_iteration(frontend_of_eight);

  for (int round = 0; round < rounds; ++round) {
    sample("iteration_2_empty", "ns", per_iteration(frontend_of_two));
    sample("iteration_8_moving", "ns", per_iteration(frontend_of_eight));
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
