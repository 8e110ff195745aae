// A backend inside a program that has a loop of its own, here at 500 Hz.
// While it runs, `o80 echo mixer` shows it and any frontend may command it.

#include <cstdio>
#include <cstdlib>
#include <thread>

#include "o80/o80.hpp"

using namespace std::chrono_literals;

namespace {

struct Motor {
  double speed;
};
O80_DESCRIBE(Motor, (speed, "[rad/s]", o80::rests_at(0)));  // 0 unless a command names it

struct Mixer {
  using Actuators = std::array<Motor, 3>;
};

}  // namespace

int main(int argc, char** argv) try {
  const long iterations = argc > 1 ? std::atol(argv[1]) : 5000;
  o80::BackendOptions options;
  options.segment = "mixer";
  options.period = 2'000'000;
  o80::Backend<Mixer> backend(options, [](o80::Schema& schema) {
    schema.actuator(0).name("slow").limits({.minimum = 0.0, .maximum = 10.0});
    schema.actuator(1).name("middle").limits({.minimum = 0.0, .maximum = 50.0});
    schema.actuator(2).name("fast").limits({.minimum = 0.0, .maximum = 200.0});
  });

  Mixer::Actuators motors{};
  backend.publish(motors);
  auto next = std::chrono::steady_clock::now();
  for (long i = 0; i < iterations; ++i) {
    const auto desired = backend.step();
    if (!desired) break;
    motors = *desired;  // simulated: the motors follow at once
    std::this_thread::sleep_until(next += 2ms);
    backend.publish(motors);
  }
  std::printf("mixed for %ld iterations\n", backend.untyped().iteration());
  return 0;
} catch (const o80::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
