// Bursts: of one iteration, there and back, beside a bare cache line's round trip, and its work
// without any way; of many, for an empty robot and for eight actuators in motion.

#include "empty_robot.hpp"
#include "ping_pong.hpp"

namespace o80::bench {
namespace {

constexpr int kIterations = 20'000;  // of a long burst
constexpr auto kPatience = std::chrono::seconds(20);

double burst_round_trip(UntypedFrontend& frontend, int count) {
  return nanoseconds([&] {
           for (int i = 0; i < count; ++i) frontend.burst(1, kPatience);
         }) /
         count;
}

double per_iteration(UntypedFrontend& frontend) {
  return nanoseconds([&] { frontend.burst(kIterations, kPatience); }) / kIterations;
}

/// Commands that last longer than everything measured here.
void set_in_motion(Frontend<EightWithSensors>& frontend) {
  for (std::uint32_t i = 0; i < 8; ++i) {
    frontend.add_command(i, 1.0 + i, {.pace = iterations(2'000'000'000), .mode = Mode::overwrite});
  }
  frontend.pulse();
}

void measure_round_trips(int rounds) {
  const std::string name = segment_name("burst");
  const Running<TwoEmpty> robot(name);
  UntypedFrontend frontend(name);
  burst_round_trip(frontend, 1000);
  PingPong line;

  // the same calls, frontend's and backend's one after the other in one thread
  const auto inline_robot = std::make_shared<InlineRobot>(
      std::make_unique<DriverInstance>(*robot_table<TwoEmpty>("empty"), OptionValues{}),
      BackendOptions{.segment = name + "-inline", .bursting = true});
  UntypedFrontend inline_frontend(inline_robot->backend(), inline_robot);

  for (int round = 0; round < rounds; ++round) {
    line.rest(false);
    line.round_trip(1000);
    sample("cache_line_round_trip", "ns", line.round_trip(20'000));
    line.rest(true);
    burst_round_trip(frontend, 200);
    sample("burst_1", "ns", burst_round_trip(frontend, 5000));
    sample("burst_1_inline", "ns", burst_round_trip(inline_frontend, 5000));
  }
}

void measure_iterations(int rounds) {
  const std::string two_name = segment_name("two");
  const std::string eight_name = segment_name("eight");
  const Running<TwoEmpty> two(two_name, 1);
  const Running<EightWithSensors> eight(eight_name, 1);
  pin(0);
  UntypedFrontend frontend_of_two(two_name);
  Frontend<EightWithSensors> frontend_of_eight(eight_name);
  set_in_motion(frontend_of_eight);
  for (int round = -1; round < rounds; ++round) {
    const double empty = per_iteration(frontend_of_two);
    const double moving = per_iteration(frontend_of_eight);
    if (round < 0) continue;  // warms up
    sample("iteration_2_empty", "ns", empty);
    sample("iteration_8_moving", "ns", moving);
  }
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) {
  o80::bench::take_priority();
  o80::bench::measure_round_trips(o80::bench::rounds_of(argc, argv));
  o80::bench::measure_iterations(o80::bench::rounds_of(argc, argv));
}
