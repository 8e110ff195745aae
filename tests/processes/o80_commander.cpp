// Commands whatever backend has the segment: `o80_commander SEGMENT TARGET`, a C++ frontend that
// knows no type of the robot. Prints what the first actuator was asked at the end, and its status.

#include <cstdio>

#include "o80/o80.hpp"

using namespace std::chrono_literals;

int main(int argc, char** argv) try {
  if (argc != 3) return 2;
  o80::Frontend<> frontend(argv[1]);
  const double target = std::atof(argv[2]);
  frontend.add_command(0, std::as_bytes(std::span(&target, 1)), {.pace = o80::iterations(20)});
  const o80::UntypedObservation last = frontend.pulse_and_wait(20s);
  std::printf("%.17g at %ld\n", o80::unpack<double>(last.desired()), last.iteration());
  return 0;
} catch (const o80::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
