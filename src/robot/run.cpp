#include "o80/robot/run.hpp"

#include <unistd.h>
#include <csignal>

#include <atomic>
#include <cstdio>
#include <memory>
#include <thread>

#include "o80/base/error.hpp"
#include "o80/robot/loop.hpp"
#include "o80/robot/real_time.hpp"
#include "o80/robot/run_options.hpp"

namespace o80 {

namespace {

std::atomic<Loop*> running_loop{nullptr};

void stop_on_signal(int) {
  if (Loop* loop = running_loop.load()) loop->ask_to_stop();
}

void set_signals(void (*handler)(int)) {
  struct sigaction action{};
  action.sa_handler = handler;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

/// Stops the loop when whoever started the process has gone: its standard input ends.
void watch_input() {
  std::thread([] {
    char byte;
    ssize_t got = 0;
    while ((got = read(STDIN_FILENO, &byte, 1)) > 0 || (got < 0 && errno == EINTR)) {
    }
    stop_on_signal(0);
  }).detach();
}

void announce(const RobotTable& table, const UntypedBackend& backend) {
  const SchemaHead& head = backend.schema().head;
  std::printf("%s runs on segment '%s', ", table.name, backend.name().c_str());
  if (head.bursting != 0) {
    std::printf("bursting, %g ms an iteration", static_cast<double>(head.period) * 1e-6);
  } else {
    std::printf("%g Hz", 1e9 / static_cast<double>(head.period));
  }
  std::printf(", pid %d\n", getpid());
  std::fflush(stdout);
}

int run_robot(const RobotTable& table, const RunOptions& options) {
  OwnedSegment::refuse_if_taken(options.backend.segment);
  Loop loop(std::make_unique<Robot>(table, options.robot), options.backend);
  running_loop = &loop;
  set_signals(stop_on_signal);
  if (options.until_eof) watch_input();
  loop.start();
  for (const std::string& refused : set_up_real_time(options.real_time)) {
    std::fprintf(stderr, "o80: %s\n", refused.c_str());
  }
  announce(table, loop.backend());
  const Ended ended = loop.run();
  set_signals(SIG_IGN);
  running_loop = nullptr;
  if (!ended.in_order) std::fprintf(stderr, "o80: %s\n", ended.fault.c_str());
  return ended.in_order ? 0 : 1;
}

}  // namespace

int run(const RobotTable& table, int argc, char** argv) {
  try {
    const RunOptions options = parse_run_options(table, argc, argv);
    if (options.help) {
      std::fputs(run_help(table).c_str(), stdout);
      return 0;
    }
    return run_robot(table, options);
  } catch (const InvalidArgument& error) {
    std::fprintf(stderr, "o80: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "o80: %s\n", error.what());
    return 1;
  }
}

}  // namespace o80
