// burst(1) there and back, beside a bare cache line's round trip, and its work without any way.

#include "empty_robot.hpp"
#include "ping_pong.hpp"

namespace o80::bench {
namespace {

double burst_round_trip(UntypedFrontend& frontend, int count) {
  return nanoseconds([&] {
           for (int i = 0; i < count; ++i) frontend.burst(1, std::chrono::seconds(5));
         }) /
         count;
}

void measure(int rounds) {
  take_priority();
  const std::string name = segment_name("burst");
  const Running<TwoEmpty> robot(name);
  UntypedFrontend frontend(name);
  burst_round_trip(frontend, 1000);
  PingPong line;

  // the same calls, frontend's and backend's one after the other in one thread
  const auto inline_robot = std::make_shared<InlineRobot>(
      std::make_unique<DriverInstance>(*robot_table<TwoEmpty>("empty"), OptionValues{}),
      BackendOptions{.segment = name + "-inline", .bursting = true});
  UntypedFrontend inline_frontend(name + "-inline", inline_robot);

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

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) { o80::bench::measure(o80::bench::rounds_of(argc, argv)); }
