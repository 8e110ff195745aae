// What an operator does with the robot of a segment: `o80_operator SEGMENT VERB`.
//   state       prints "runs", or "halted NUMBER CAUSE: TEXT"
//   move N      sends every actuator on a way of 20 s; prints the status N rows later
//   halt        halts it
//   resume N    ends the halt of this number
//   watch       waits for the end of the backend; prints how it ended and how many rows braked

#include <cstdio>
#include <cstdlib>
#include <string>

#include "o80/o80.hpp"

using namespace std::chrono_literals;

namespace {

void print_state(o80::UntypedFrontend& frontend) {
  const auto halt = frontend.halted();
  if (!halt) {
    std::puts("runs");
    return;
  }
  std::printf("halted %llu %s: %s\n", static_cast<unsigned long long>(halt->number),
              std::string(o80::to_text(halt->cause)).c_str(), std::string(halt->reason()).c_str());
}

void move(o80::UntypedFrontend& frontend, o80::Iteration rows) {
  const double target = 2.0;
  const auto bytes = std::as_bytes(std::span(&target, 1));
  const auto count = static_cast<std::uint32_t>(frontend.schema().actuators.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    frontend.add_command(i, bytes, {.pace = o80::duration(20s)});
  }
  const o80::Batch batch = frontend.pulse();
  frontend.wait_for(frontend.published() + rows, 60s);
  std::puts(std::string(o80::to_text(batch.handle(0).status)).c_str());
}

void watch(o80::UntypedFrontend& frontend) {
  const char* end = "timed out";
  try {
    frontend.wait_for(1'000'000'000, 60s);
  } catch (const o80::BackendStopped&) {
    end = "stopped";
  } catch (const o80::BackendGone&) {
    end = "gone";
  } catch (const o80::TimeoutError&) {
  }
  std::size_t braking = 0;
  for (std::int64_t i = frontend.published(); i > 0 && i > frontend.published() - 200; --i) {
    braking += frontend.wait_for(i, 1s).any_braking() ? 1 : 0;
  }
  std::printf("%s, %zu rows braked\n", end, braking);
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) return 2;
  o80::UntypedFrontend frontend(argv[1], {.timeout = 60s});
  const std::string verb = argv[2];
  const std::uint64_t number = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  if (verb == "state") print_state(frontend);
  if (verb == "move") move(frontend, static_cast<o80::Iteration>(number));
  if (verb == "halt") frontend.halt("the operator says so");
  if (verb == "resume") frontend.resume(number, 60s);
  if (verb == "watch") watch(frontend);
  return 0;
} catch (const o80::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
