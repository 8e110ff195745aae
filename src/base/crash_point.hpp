#pragma once

/// A named place at which a test may kill or stop the process, to prove that nothing breaks there.
///
/// Compiles to nothing unless O80_CRASH_POINTS is defined. Then the process sends itself a signal
/// when it passes the point of its crash plan, which is empty unless armed: by the program, or by
/// the environment variable O80_CRASH_AT, "label" or "label:n" for the n-th passage (SIGKILL).
#ifdef O80_CRASH_POINTS

#include <signal.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <string>

namespace o80 {

struct CrashPlan {
  std::string label{};
  std::atomic<long> passages_left{0};  // 0: nothing is planned
  int signal = SIGKILL;
  void (*before)() = nullptr;  // told just before the signal
  void (*after)() = nullptr;   // and when a stopped process goes on

  CrashPlan() {
    const char* target = secure_getenv("O80_CRASH_AT");
    if (target == nullptr) return;
    const char* colon = std::strchr(target, ':');
    label = colon == nullptr ? target : std::string(target, colon);
    passages_left = colon == nullptr ? 1 : std::strtol(colon + 1, nullptr, 10);
  }
};

inline CrashPlan& crash_plan() {
  static CrashPlan plan;
  return plan;
}

inline void pass_crash_point(const char* label) noexcept {
  CrashPlan& plan = crash_plan();
  if (plan.passages_left.load(std::memory_order_relaxed) <= 0 || plan.label != label) return;
  if (plan.passages_left.fetch_sub(1) != 1) return;
  if (plan.before != nullptr) plan.before();
  raise(plan.signal);
  if (plan.after != nullptr) plan.after();
}

}  // namespace o80

#define O80_CRASH_POINT(label) ::o80::pass_crash_point(label)
#else
#define O80_CRASH_POINT(label) static_cast<void>(0)
#endif
