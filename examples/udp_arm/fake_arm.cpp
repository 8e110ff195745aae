// An arm that is not there: it answers on the loopback as the real one would.
//
//   fake_arm [--port 5700] [--frequency 100] [--timeout TICKS] [--faults "drop 50-52, late 60"]

#include <getopt.h>
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <stdexcept>
#include <string>

#include "fake_arm.hpp"

namespace udp_arm {
namespace {

const char* name_of(Mode mode) {
  switch (mode) {
    case Mode::ready:
      return "ready";
    case Mode::moving:
      return "moving";
    case Mode::timed_out:
      return "timed out: no command came";
    default:
      return "failed";
  }
}

double number(const char* text, double minimum) {
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (end == text || *end != 0 || !(value >= minimum)) {
    throw std::invalid_argument(std::string("a value must be a number of at least ") +
                                std::to_string(minimum) + ", got '" + text + "'");
  }
  return value;
}

FakeArm::Options parse(int argc, char** argv) {
  const option known[] = {{"port", required_argument, nullptr, 'p'},
                          {"frequency", required_argument, nullptr, 'f'},
                          {"timeout", required_argument, nullptr, 't'},
                          {"faults", required_argument, nullptr, 'x'},
                          {nullptr, 0, nullptr, 0}};
  FakeArm::Options options{.port = 5700};
  for (int chosen = 0; (chosen = getopt_long(argc, argv, "", known, nullptr)) != -1;) {
    if (chosen == 'p') options.port = static_cast<int>(number(optarg, 0));
    if (chosen == 'f') options.period = std::llround(1e9 / number(optarg, 1e-3));
    if (chosen == 't') options.command_timeout = static_cast<std::uint64_t>(number(optarg, 1));
    if (chosen == 'x') options.faults = LinkFaults(optarg);
    if (chosen == '?') throw std::invalid_argument("see the first lines of fake_arm.cpp");
  }
  return options;
}

[[noreturn]] void run(FakeArm& arm, std::int64_t period) {
  Mode before = arm.mode();
  // delayed, it leaves out ticks: an arm does not make up for them
  for (std::int64_t due = now() + period;; due = std::max(due + period, now())) {
    const timespec until{due / 1'000'000'000, due % 1'000'000'000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) {
    }
    arm.tick();
    if (arm.mode() == before) continue;
    before = arm.mode();
    std::printf("tick %llu: %s\n", static_cast<unsigned long long>(arm.state().tick),
                name_of(before));
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace udp_arm

int main(int argc, char** argv) {
  try {
    const udp_arm::FakeArm::Options options = udp_arm::parse(argc, argv);
    udp_arm::FakeArm arm(options);
    std::printf("an arm listens on 127.0.0.1:%d\n", arm.port());
    std::fflush(stdout);
    udp_arm::run(arm, options.period);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fake_arm: %s\n", error.what());
    return 1;
  }
}
