#include "o80/robot/run.hpp"

#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string_view>
#include <thread>

#include "base/printable.hpp"
#include "base/signals_blocked.hpp"
#include "describe/number_name.hpp"
#include "memory/os/descriptors.hpp"
#include "memory/segment/owned_segment.hpp"
#include "o80/base/error.hpp"
#include "o80/base/time.hpp"
#include "o80/robot/real_time.hpp"
#include "robot/loop/loop.hpp"
#include "robot/loop/loop_report.hpp"
#include "robot/loop/robot_provenance.hpp"
#include "robot/loop/run_options.hpp"
#include "robot/loop/service_manager.hpp"

namespace o80 {

namespace {

std::atomic<bool> stop_asked{false};
std::atomic<Loop*> running_loop{nullptr};
pthread_t loop_thread;                                // of running_loop
constexpr std::int64_t kLongestStop = 3'000'000'000;  // braking, and stop() of the driver [ns]
std::mutex ending;  // held by other threads while they use the loop

/// Runs in a signal handler: async-signal-safe operations only.
void stop_on_signal(int) {
  stop_asked.store(true);
  if (Loop* loop = running_loop.load()) loop->ask_to_stop();
}

/// Signals that do not end a process, or cannot be caught.
constexpr int kHarmless[] = {SIGKILL, SIGSTOP, SIGTSTP, SIGTTIN, SIGTTOU,
                             SIGCONT, SIGCHLD, SIGURG,  SIGWINCH};
/// Requests to stop. A shell ignores the first two for programs that it starts with `&`.
constexpr int kAsked[] = {SIGINT, SIGQUIT, SIGTERM};
constexpr int kUnwritable[] = {SIGPIPE, SIGXFSZ};  // of a failed write
constexpr int kFaults[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP, SIGSYS};

bool is_one_of(std::span<const int> numbers, int number) {
  return std::ranges::find(numbers, number) != numbers.end();
}

/// The same for a signal that a process has sent (`kill -SEGV`). A fault of this process ends it:
/// its next instruction would fault again.
void stop_on_sent_fault(int number, siginfo_t* info, void*) {
  if (info->si_code == SI_USER || info->si_code == SI_QUEUE) return stop_on_signal(number);
  signal(number, SIG_DFL);
  if (info->si_code <= 0) raise(number);  // abort(): delivered when this handler returns
}

/// While this object exists, every signal that would end the process stops the loop in order:
/// SIGINT, SIGQUIT and SIGTERM always, others unless the program has a handler of its own or
/// ignores them. Signals of failed writes (SIGPIPE, SIGXFSZ) are ignored.
class StopSignals {
 public:
  StopSignals() {
    stop_asked = false;
    for (int number = 1; number < NSIG; ++number) {
      struct sigaction& before = before_[static_cast<std::size_t>(number)];
      const bool readable = sigaction(number, nullptr, &before) == 0;
      const bool always = is_one_of(kAsked, number);
      const bool unwritable = is_one_of(kUnwritable, number);
      const bool is_free = (before.sa_flags & SA_SIGINFO) == 0 && before.sa_handler == SIG_DFL;
      if (!readable || is_one_of(kHarmless, number) || !(always || unwritable || is_free)) {
        before.sa_flags = kUntouched;
        continue;
      }
      struct sigaction action{};
      if (unwritable) {
        action.sa_handler = SIG_IGN;
      } else if (is_one_of(kFaults, number)) {
        action.sa_flags = SA_SIGINFO;
        action.sa_sigaction = stop_on_sent_fault;
      } else {
        action.sa_handler = stop_on_signal;
      }
      sigaction(number, &action, nullptr);
    }
  }
  StopSignals& operator=(StopSignals&&) = delete;
  ~StopSignals() {
    for (int number = 1; number < NSIG; ++number) {
      const struct sigaction& before = before_[static_cast<std::size_t>(number)];
      if (before.sa_flags != kUntouched) sigaction(number, &before, nullptr);
    }
  }

 private:
  static constexpr int kUntouched = -1;
  struct sigaction before_[NSIG]{};
};

/// Runs when a library calls exit() while the robot moves: the loop stops before the process ends.
void stop_at_exit() {
  {
    const std::scoped_lock lock(ending);
    Loop* const loop = running_loop.load();
    if (loop == nullptr) return;
    std::fputs("o80: exit() was called while the robot runs: it is stopped first\n", stderr);
    if (pthread_equal(loop_thread, pthread_self()) != 0) return loop->end_by_exit();
    loop->ask_to_stop();
  }
  const std::int64_t end = monotonic_now() + kLongestStop;
  while (running_loop.load() != nullptr && monotonic_now() < end) usleep(1000);
}

/// While this object exists, signals and exit() stop this loop.
class Running {
 public:
  explicit Running(Loop& loop) {
    static const bool at_exit = std::atexit(stop_at_exit) == 0;
    static_cast<void>(at_exit);
    loop_thread = pthread_self();
    running_loop = &loop;
    if (stop_asked) loop.ask_to_stop();
  }
  Running& operator=(Running&&) = delete;
  ~Running() {
    const std::scoped_lock lock(ending);
    running_loop = nullptr;
  }
};

/// Stops the loop at the end of the standard input, that is, when the starting process has ended.
void watch_input() {
  const SignalsBlocked blocked;
  std::thread([] {
    char byte;
    ssize_t got = 0;
    while ((got = read(STDIN_FILENO, &byte, 1)) > 0 || (got < 0 && errno == EINTR)) {
    }
    const std::scoped_lock lock(ending);
    stop_on_signal(0);
  }).detach();
}

/// Prints to the standard error, after what the driver has printed so far.
void complain(const char* text) {
  std::fflush(stdout);
  std::fprintf(stderr, "o80: %s\n", text);
}

/// Publishes the fault of a robot that cannot be constructed in a small segment, so that waiting
/// frontends raise it.
void leave_fault(const RobotTable& table, const RunOptions& run, const char* why) noexcept {
  const BackendOptions& options = run.backend;
  try {
    BackendOptions least;
    least.segment = options.segment;
    least.permission = options.permission;
    least.history = 1;
    least.lanes = 1;
    least.lane_blocks = 16;
    least.provenance = provenance_of(table, run.robot);
    UntypedBackend backend(Schema(), least);
    backend.end(BackendState::failed, why);
  } catch (const std::exception& error) {
    if (std::string_view(error.what()) == why) return;  // the caller reports it
    std::fprintf(stderr, "o80: the fault cannot be published for waiting frontends: %s\n",
                 error.what());
  }
}

std::unique_ptr<Loop> make_loop(const RobotTable& table, const RunOptions& options) {
  OwnedSegment::refuse_if_taken(options.backend.segment);
  try {
    BackendOptions backend = options.backend;
    backend.provenance.run_options = texts_of(options.real_time);
    return std::make_unique<Loop>(std::make_unique<DriverInstance>(table, options.robot), backend);
  } catch (const SegmentTaken&) {
    throw;
  } catch (const std::exception& error) {
    leave_fault(table, options, error.what());
    throw;
  }
}

/// The names of the numbers without an acceleration limit, which a halt or stop brings to rest in
/// one iteration: at most three, and how many more there are.
std::string stops_at_once(const Schema& schema) {
  constexpr std::uint32_t kNamed = 3;
  std::string names;
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < schema.actuators.size(); ++i) {
    const ActuatorRow& row = schema.actuators[i];
    std::uint32_t number = 0;
    schema.each_scalar(row.type, [&](std::uint32_t, const FieldRow& field) {
      const LimitRow& limit = schema.limits[row.first_limit + number];
      const std::uint32_t here = number++;
      const bool moves = field.kind != Kind::boolean && field.kind != Kind::enumeration;
      if (!moves || std::isfinite(limit.acceleration)) return;
      if (count++ >= kNamed) return;
      ShortText<200> name;
      name_number(schema, i, here, name);
      names += (names.empty() ? "" : ", ") + std::string(name.view());
    });
  }
  return count > kNamed ? names + " and " + std::to_string(count - kNamed) + " more" : names;
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
  const std::string at_once = stops_at_once(backend.schema());
  if (head.bursting == 0 && !at_once.empty()) {
    std::printf("no acceleration limit on %s: a halt or stop ends its motion in one iteration\n",
                at_once.c_str());
  }
  std::fflush(stdout);
}

/// True if the calling thread is an ordinary one that may have this real-time priority. It stays an
/// ordinary one.
bool may_have_priority(int priority) noexcept {
  const sched_param real_time{priority};
  const sched_param ordinary{};
  if (sched_getscheduler(0) != SCHED_OTHER) return false;
  if (sched_setscheduler(0, SCHED_FIFO, &real_time) != 0) return false;
  sched_setscheduler(0, SCHED_OTHER, &ordinary);
  return true;
}

/// True for a driver in C++ of a robot of the world, in real time, where another processor is left.
bool admits_automatic(const SchemaHead& head) noexcept {
  cpu_set_t allowed;
  return head.of_the_world == 1 && head.bursting == 0 &&
         sched_getaffinity(0, sizeof allowed, &allowed) == 0 && CPU_COUNT(&allowed) > 1;
}

int run_robot(const RobotTable& table, const RunOptions& options) {
  const StopSignals signals;
  const std::unique_ptr<Loop> loop = make_loop(table, options);
  const Running running(*loop);
  if (options.until_eof) watch_input();
  std::optional<LoopReport> report(std::in_place, loop->backend().name());
  RealTimeOptions real_time = options.real_time;
  real_time.sleeps = !options.backend.bursting && table.paces_itself == 0;
  // whoever waits for the robot to run finds these lines in its output
  const SchemaHead& head = loop->backend().schema().head;
  const bool automatic = real_time.policy == RealTimeOptions::Policy::automatic;
  if (automatic && !admits_automatic(head)) real_time.policy = RealTimeOptions::Policy::other;
  loop->start([&] {
    for (const std::string& refused : set_up_real_time(real_time)) complain(refused.c_str());
  });
  announce(table, loop->backend());
  if (automatic) {
    std::puts((sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO
                  ? "policy auto: fifo, as long as the loop sleeps at least every 200 ms"
                  : "policy auto: other. fifo needs permission, two processors, real time, and a "
                    "driver in C++ that is not simulated (docs/real_time.md)");
    std::fflush(stdout);
  }
  if (!options.has_policy && head.bursting == 0 && !head.is_simulated() &&
      may_have_priority(options.real_time.priority)) {
    std::puts("this computer allows --policy fifo: busy programs then do not delay the loop");
    std::fflush(stdout);
  }
  notify_service_manager("READY=1\nSTATUS=runs on segment '" + loop->backend().name() + "'");
  const Ended ended = loop->run();
  report.reset();
  if (!ended.in_order) complain(ended.fault.c_str());
  notify_service_manager("STOPPING=1\nSTATUS=" +
                         (ended.in_order ? "stopped" : printable(ended.fault)));
  return ended.in_order ? 0 : 1;
}

}  // namespace

const char* program_name(const char* path) noexcept {
  const char* slash = std::strrchr(path, '/');
  return slash == nullptr ? path : slash + 1;
}

int run(const RobotTable& table, int argc, char** argv) {
  open_standard_descriptors();
  try {
    const RunOptions options = parse_run_options(table, argc, argv);
    if (options.help) {
      std::fputs(run_help(table).c_str(), stdout);
      return 0;
    }
    return run_robot(table, options);
  } catch (const InvalidArgument& error) {
    complain(error.what());
    return 2;
  } catch (const std::exception& error) {
    complain(error.what());
    return 1;
  }
}

}  // namespace o80
