#pragma once

/// A labelled place at which a test kills or stops the process, to prove that the others survive.
///
/// Compiles to nothing unless O80_CRASH_POINTS is defined. With it, the process sends itself a
/// signal at the label of its crash plan. A plan comes from the program, or from the environment
/// variable O80_CRASH_AT: "label", or "label:n" for the n-th passage (SIGKILL). Without a plan
/// nothing happens.
#ifdef O80_CRASH_POINTS

#include <signal.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <string>

namespace o80 {

struct CrashPlan {
  std::string label{};
  std::atomic<long> passages_left{0};  // 0: no plan
  int signal = SIGKILL;
  void (*before)() = nullptr;  // called just before the signal
  void (*after)() = nullptr;   // called when a stopped process continues

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
