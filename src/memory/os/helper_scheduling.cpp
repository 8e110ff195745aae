#include "memory/os/helper_scheduling.hpp"

#include <algorithm>
#include <future>
#include <thread>

namespace o80 {

namespace {

int set_priority(pthread_t thread, int priority) noexcept {
  sched_param parameter{};
  parameter.sched_priority = priority;
  return pthread_setschedparam(thread, priority > 0 ? SCHED_FIFO : SCHED_OTHER, &parameter);
}

}  // namespace

void HelperScheduling::start_from_caller() noexcept {
  if (sched_getaffinity(0, sizeof allowed_, &allowed_) != 0) CPU_ZERO(&allowed_);
}

void HelperScheduling::run_above(int priority) noexcept { above_ = std::max(above_, priority); }

int HelperScheduling::apply(pthread_t helper) const noexcept {
  apply_processors(helper);
  return apply_priority(helper);
}

int HelperScheduling::apply_to_trial() const {
  std::promise<void> over;
  std::thread trial([&over] { over.get_future().wait(); });
  const int refused = apply(trial.native_handle());
  over.set_value();
  trial.join();
  return refused;
}

int HelperScheduling::apply_priority(pthread_t helper) const noexcept {
  if (above_ == 0) return set_priority(helper, 0);
  const int wanted = std::min(above_ + 1, sched_get_priority_max(SCHED_FIFO));
  const int refused = set_priority(helper, wanted);
  if (refused != 0 && set_priority(helper, above_) != 0) set_priority(helper, 0);
  return refused;
}

/// Prefers the processors of its starter without the avoided ones, then any processor that is not
/// avoided, then those of its starter.
void HelperScheduling::apply_processors(pthread_t helper) const noexcept {
  cpu_set_t any;
  CPU_ZERO(&any);
  for (int i = 0; i < CPU_SETSIZE; ++i) CPU_SET(i, &any);
  cpu_set_t wanted = allowed_;
  for (const int processor : avoided_)
    if (processor >= 0 && processor < CPU_SETSIZE) {
      CPU_CLR(processor, &wanted);
      CPU_CLR(processor, &any);
    }
  if (CPU_COUNT(&wanted) > 0 && pthread_setaffinity_np(helper, sizeof wanted, &wanted) == 0) return;
  if (pthread_setaffinity_np(helper, sizeof any, &any) == 0) return;
  pthread_setaffinity_np(helper, sizeof allowed_, &allowed_);
}

int real_time_priority() noexcept {
  sched_param parameter{};
  const int policy = sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
  if (policy != SCHED_FIFO && policy != SCHED_RR) return 0;
  return sched_getparam(0, &parameter) == 0 ? parameter.sched_priority : 0;
}

}  // namespace o80
