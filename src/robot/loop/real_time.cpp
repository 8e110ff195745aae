#include "o80/robot/real_time.hpp"

#include <alloca.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "memory/segment/liveness.hpp"
#include "robot/driver/machine_limits.hpp"
#include "robot/loop/loop_options.hpp"
#include "robot/loop/realtime_kit.hpp"

namespace o80 {

namespace {

constexpr int kPage = 4096;
constexpr rlim_t kLongestRun = 200'000;  // without sleep, with policy automatic [us]

std::string allowed_by(const MachineLimit& limit) {
  return std::string("Allow it in this shell with `") + limit.at_once + "`, for good with `" +
         limit.for_good + "`";
}

/// Touches the pages of the stack, so that the loop causes no page fault there.
__attribute__((noinline)) void touch_stack(std::size_t bytes) {
  auto* stack = static_cast<volatile char*>(alloca(bytes));
  for (std::size_t i = 0; i < bytes; i += kPage) stack[i] = 0;
}

void set_policy(const RealTimeOptions& options, std::vector<std::string>& refused) {
  const bool round_robin = options.policy == RealTimeOptions::Policy::round_robin;
  const bool automatic = options.policy == RealTimeOptions::Policy::automatic;
  sched_param parameter{};
  parameter.sched_priority = options.priority;
  int policy = round_robin ? SCHED_RR : SCHED_FIFO;
  // its guard does not reach programs that the thread starts: SIGXCPU would end them
  if (automatic) policy |= SCHED_RESET_ON_FORK;
  if (sched_setscheduler(0, policy, &parameter) != 0) {
    if (automatic) return;
    std::string text = "real-time priority " + std::to_string(options.priority) + " was refused (" +
                       std::strerror(errno) + ")";
    if (options.sleeps) text += "; " + ask_realtime_kit(options.priority);
    refused.push_back(text + ". " + allowed_by(kPriorityLimit));
    return;
  }
  if (automatic) limit_running(kLongestRun, RLIM_INFINITY);
  // the liveness helper must not wait for this loop or another one: it gets a higher priority
  const int why = LaneLiveness::run_above(options.priority);
  if (why == 0) return;
  refused.push_back("real-time priority " + std::to_string(options.priority + 1) +
                    " was refused to the helper thread that notices dead frontends (" +
                    std::strerror(why) +
                    "): while real-time threads leave no processor free, "
                    "deaths are noticed late. " +
                    allowed_by(kPriorityLimit));
}

void set_processors(const RealTimeOptions& options, std::vector<std::string>& refused) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int processor : options.processors) CPU_SET(processor, &set);  // if it is in range
  LaneLiveness::avoid_processors(options.processors);
  std::vector<int> missing = options.processors;
  std::string why = "the others are used";
  if (sched_setaffinity(0, sizeof set, &set) != 0) {
    why = std::strerror(errno);
  } else if (sched_getaffinity(0, sizeof set, &set) == 0) {
    // the kernel accepts a list if one processor exists, and silently drops the others
    std::erase_if(missing, [&](int processor) { return CPU_ISSET(processor, &set); });
  }
  if (missing.empty()) return;
  refused.push_back("processors " + text_of(missing) + " were refused (" + why +
                    "). This machine has " + std::to_string(sysconf(_SC_NPROCESSORS_ONLN)) +
                    ": `lscpu` lists them, `taskset -p $$` those that may be used");
}

void lock_memory(std::vector<std::string>& refused) {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return;
  refused.push_back(std::string("locked memory was refused (") + std::strerror(errno) + "). " +
                    allowed_by(kMemoryLimit));
}

}  // namespace

std::vector<std::string> set_up_real_time(const RealTimeOptions& options) {
  std::vector<std::string> refused;
  if (options.lock_memory) lock_memory(refused);
  touch_stack(options.stack);
  if (!options.processors.empty()) set_processors(options, refused);
  if (options.policy != RealTimeOptions::Policy::other) set_policy(options, refused);
  return refused;
}

}  // namespace o80
