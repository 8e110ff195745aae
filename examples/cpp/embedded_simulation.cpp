// A bursting backend inside a simulation: it waits until a frontend requests iterations.
// Here the frontend is in a thread of this process; it could be in any process.

#include <cstdio>
#include <thread>

#include "o80/o80.hpp"

using namespace std::chrono_literals;

namespace {

struct Cart {
  double position, velocity;
};
O80_DESCRIBE(Cart, (position, "[m]"), (velocity, "[m/s]"));

struct CartWorld {
  using Actuators = std::array<Cart, 1>;
};

void learn() {
  o80::Frontend<CartWorld> world("cart");
  for (int step = 1; step <= 3; ++step) {
    world.add_command("actuator_0", Cart{0.1 * step, 0.0}, {.pace = o80::iterations(10)});
    const auto observation = world.burst(10);
    std::printf("step %d: iteration %ld, simulated time %.3f s, cart at %.2f m\n", step,
                observation.iteration(), static_cast<double>(observation.time()) * 1e-9,
                observation.observed()[0].position);
  }
}

}  // namespace

int main() try {
  o80::BackendOptions options;
  options.segment = "cart";
  options.bursting = true;
  o80::Backend<CartWorld> backend(options);
  CartWorld::Actuators carts{};
  backend.publish(carts);

  std::thread learner([&] {
    learn();
    backend.untyped().ask_to_stop();
  });
  while (const auto desired = backend.step()) {  // waits until a frontend requests iterations
    carts = *desired;
    backend.publish(carts);
  }
  learner.join();
  return 0;
} catch (const o80::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
