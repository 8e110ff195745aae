// Mirrors a real-time robot in a simulation that steps once for each of its rows.
// Start `o80 run two_joints` and `o80 run two_joints --segment twin --bursting` first.

#include <cstdio>

#include "o80/o80.hpp"

using namespace std::chrono_literals;

int main() try {
  o80::Frontend<> robot("two_joints");
  o80::Frontend<> twin("twin");

  // the robot moves by itself, the twin once for each of its iterations
  const double target = 0.8;
  robot.add_command(0, std::as_bytes(std::span(&target, 1)), {.pace = o80::duration(200ms)});
  robot.pulse();
  o80::Iteration position = robot.published() + 1;
  o80::UntypedObservation row(robot.description());
  for (int i = 0; i < 200; ++i) {
    robot.wait_for_next(position, row.bytes(), 2s);
    for (std::uint32_t joint = 0; joint < 2; ++joint) {
      twin.add_command(joint, {row.observed() + joint * sizeof(double), sizeof(double)});
    }
    const o80::UntypedObservation mirrored = twin.burst(1, 2s);
    if (i % 50 == 49) {
      std::printf("robot %.4f rad, twin asked for %.4f rad, twin's iteration %ld\n",
                  o80::unpack<double>(row.observed()), o80::unpack<double>(mirrored.desired()),
                  mirrored.iteration());
    }
  }
  return 0;
} catch (const o80::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
