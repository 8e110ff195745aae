#include "robot/loop/realtime_kit.hpp"

#include <dlfcn.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string_view>

#include "base/printable.hpp"
#include "o80/base/time.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kLongestTalk = 1'000'000'000;  // with the bus and the service [ns]
constexpr const char* kService = "org.freedesktop.RealtimeKit1";  // and its interface
constexpr const char* kObject = "/org/freedesktop/RealtimeKit1";

std::atomic<rlim_t> longest_run{RLIM_INFINITY};  // [us]

/// RealtimeKit on the system bus, by libsystemd, which is loaded here because robots run without it
/// too.
///
/// Throws std::runtime_error with what the bus or the service said.
class RealtimeKit {
 public:
  RealtimeKit() {
    if (library_ == nullptr) throw std::runtime_error("libsystemd is not installed");
    check(function<int(void**)>("sd_bus_open_system")(&bus_));
  }
  RealtimeKit& operator=(RealtimeKit&&) = delete;
  ~RealtimeKit() {
    if (bus_ != nullptr) function<void*(void*)>("sd_bus_close_unref")(bus_);
  }

  /// Returns when the bus has accepted this process: otherwise the first call waits for that,
  /// without a timeout of ours.
  void connect() {
    const auto is_ready = function<int(void*)>("sd_bus_is_ready");
    const auto process = function<int(void*, void*)>("sd_bus_process");
    const auto wait = function<int(void*, std::uint64_t)>("sd_bus_wait");
    while (check(is_ready(bus_)) == 0) {
      if (check(process(bus_, nullptr)) == 0) check(wait(bus_, time_left()));
    }
  }

  /// Type: x for 64 bits, i for 32.
  template <class Number>
  Number property(const char* name, char type) {
    Number value = 0;
    limit_next_call();
    Refusal refusal;
    const auto get = function<int(void*, const char*, const char*, const char*, const char*,
                                  Refusal*, char, void*)>("sd_bus_get_property_trivial");
    check(get(bus_, kService, kObject, kService, name, &refusal, type, &value), refusal);
    return value;
  }

  void make_real_time(pid_t thread, std::uint32_t priority) {
    limit_next_call();
    Refusal refusal;
    const auto call = function<int(void*, const char*, const char*, const char*, const char*,
                                   Refusal*, void*, const char*, ...)>("sd_bus_call_method");
    check(call(bus_, kService, kObject, kService, "MakeThreadRealtime", &refusal, nullptr, "tu",
               static_cast<std::uint64_t>(thread), priority),
          refusal);
  }

 private:
  /// sd_bus_error
  struct Refusal {
    const char* name = nullptr;
    const char* message = nullptr;
    int need_free = 0;
  };

  template <class Signature>
  Signature* function(const char* name) const {
    auto* found = reinterpret_cast<Signature*>(dlsym(library_, name));
    if (found == nullptr) throw std::runtime_error("libsystemd has no " + std::string(name));
    return found;
  }

  std::uint64_t time_left() const {
    const std::int64_t left = (end_ - monotonic_now()) / 1000;
    if (left <= 0) throw std::runtime_error("no answer within 1 s");
    return static_cast<std::uint64_t>(left);
  }

  void limit_next_call() {
    check(function<int(void*, std::uint64_t)>("sd_bus_set_method_call_timeout")(bus_, time_left()));
  }

  static int check(int result) {
    if (result >= 0) return result;
    throw std::runtime_error(std::string("system bus: ") + std::strerror(-result));
  }
  void check(int result, Refusal& refusal) {
    if (result >= 0) return;
    time_left();
    const std::string text = refusal.message == nullptr ? std::strerror(-result) : refusal.message;
    function<void(Refusal*)>("sd_bus_error_free")(&refusal);
    throw std::runtime_error(printable(text));
  }

  std::int64_t end_ = monotonic_now() + kLongestTalk;
  void* library_ = dlopen("libsystemd.so.0", RTLD_NOW | RTLD_LOCAL);
  void* bus_ = nullptr;
};

/// Runs in a signal handler: async-signal-safe operations only.
void become_ordinary(int) {
  const int before = errno;
  // the kernel signals the thread that ran for so long
  const sched_param ordinary{};
  // RealtimeKit sets the flag, and only root may take it away
  sched_setscheduler(0, SCHED_OTHER | SCHED_RESET_ON_FORK, &ordinary);
  rlimit limit{};
  getrlimit(RLIMIT_RTTIME, &limit);
  limit.rlim_cur = longest_run;  // the kernel has raised it
  setrlimit(RLIMIT_RTTIME, &limit);
  constexpr std::string_view kText =
      "o80: a thread ran too long without sleep and lost its real-time priority: it continues "
      "as an ordinary thread. See docs/real_time.md, or lower --frequency\n";
  pollfd error{.fd = STDERR_FILENO, .events = POLLOUT, .revents = 0};
  if (poll(&error, 1, 0) == 1 && write(STDERR_FILENO, kText.data(), kText.size()) < 0) errno = 0;
  errno = before;
}

}  // namespace

rlim_t limit_running(rlim_t soft, rlim_t hard) {
  struct sigaction action{};
  action.sa_handler = become_ordinary;
  action.sa_flags = SA_RESTART;
  sigaction(SIGXCPU, &action, nullptr);  // for good, as the limit is
  rlimit limit{};
  getrlimit(RLIMIT_RTTIME, &limit);
  limit.rlim_max = std::min(limit.rlim_max, hard);
  limit.rlim_cur = std::min({limit.rlim_cur, soft, limit.rlim_max / 2});
  longest_run = limit.rlim_cur;
  setrlimit(RLIMIT_RTTIME, &limit);
  return limit.rlim_cur;
}

std::string ask_realtime_kit(int priority) {
  try {
    RealtimeKit kit;
    kit.connect();
    const int highest = kit.property<std::int32_t>("MaxRealtimePriority", 'i');
    const auto longest = kit.property<std::int64_t>("RTTimeUSecMax", 'x');
    const auto hard = static_cast<rlim_t>(std::max<std::int64_t>(longest, 2));
    const rlim_t soft = limit_running(hard / 2, hard);
    kit.make_real_time(gettid(), static_cast<std::uint32_t>(std::min(priority, highest)));
    sched_param granted{};
    if (sched_getparam(0, &granted) != 0 || granted.sched_priority == 0) {
      throw std::runtime_error("it agreed, but nothing changed");
    }
    return "RealtimeKit granted " + std::to_string(granted.sched_priority) +
           ", until the loop runs for " + std::to_string(soft / 1000) + " ms without sleep";
  } catch (const std::exception& error) {
    return "RealtimeKit granted none (" + std::string(error.what()) + ")";
  }
}

}  // namespace o80
