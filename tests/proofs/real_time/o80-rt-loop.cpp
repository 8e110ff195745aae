// A robot of two joints whose loop watches itself: `o80-rt-loop --iterations N` and every flag of
// `o80 run`. After N iterations it stops in order and prints what happened between the first and
// the last to the loop's thread: page faults, allocations, context switches.

#include <sched.h>
#include <sys/resource.h>

#include <array>
#include <cstdio>

#include "count_allocations.hpp"
#include "o80/o80.hpp"

namespace {

class WatchedJoints {
 public:
  struct Config {
    std::int64_t iterations = 5000;
  };
  using Actuators = std::array<double, 2>;

  explicit WatchedJoints(const Config& config) : config_(config) {}
  void describe(o80::Schema& schema) const { schema.simulated(); }
  void start() {}
  void write(const o80::Desired<WatchedJoints>& desired) { now_ = desired.states; }
  void read(o80::Reading<WatchedJoints>& reading) {
    reading.observed = now_;
    if (reading.iteration() == 1) first_ = look();
    if (reading.iteration() < config_.iterations) return;
    last_ = look();
    sched_getparam(0, &scheduling_);
    policy_ = sched_getscheduler(0);
    reading.finish();
  }
  void stop() noexcept {
    std::printf("loop: iterations=%lld allocations=%zu minor_faults=%ld major_faults=%ld ",
                static_cast<long long>(config_.iterations), last_.allocated - first_.allocated,
                last_.usage.ru_minflt - first_.usage.ru_minflt,
                last_.usage.ru_majflt - first_.usage.ru_majflt);
    std::printf("slept=%ld preempted=%ld policy=%d priority=%d\n",
                last_.usage.ru_nvcsw - first_.usage.ru_nvcsw,
                last_.usage.ru_nivcsw - first_.usage.ru_nivcsw, policy_,
                scheduling_.sched_priority);
  }

 private:
  struct Account {
    rusage usage{};             // of the loop's thread
    std::size_t allocated = 0;  // by it
  };
  static Account look() {
    Account account;
    getrusage(RUSAGE_THREAD, &account.usage);
    account.allocated = allocations;
    return account;
  }

  Config config_;
  Actuators now_{};
  Account first_, last_;
  sched_param scheduling_{};
  int policy_ = -1;
};
O80_DESCRIBE(WatchedJoints::Config, (iterations, "after which it stops"));

}  // namespace

int main(int argc, char** argv) { return o80::run<WatchedJoints>(argc, argv, "watched"); }
