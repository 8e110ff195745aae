#include "memory/os/spinner.hpp"

#include <sched.h>

#include <algorithm>

namespace o80 {

namespace {

int count_processors() noexcept {
  cpu_set_t processors;
  return sched_getaffinity(0, sizeof processors, &processors) == 0 ? CPU_COUNT(&processors) : 2;
}

/// Counted before a thread of the process is pinned: the bell of a loop that is pinned to one
/// processor is still rung from another.
const int kProcessors = count_processors();

}  // namespace

Spinner::Spinner() noexcept : Spinner(kProcessors) {}

Spinner Spinner::lasting(std::int64_t longest) noexcept { return Spinner(kProcessors, longest); }

bool Spinner::should_spin() noexcept {
  const auto relaxed = std::memory_order_relaxed;
  const std::uint32_t refused = refused_.load(relaxed);
  const bool probe = refused + 1 >= kProbe;
  const bool hopeful = failures_.load(relaxed) < kPatience;
  const bool spins = processors_ > 1 && (hopeful || probe);
  refused_.store(spins || probe ? 0 : refused + 1, relaxed);
  return spins;
}

std::int64_t Spinner::let_others_run(std::int64_t now) noexcept {
  const auto relaxed = std::memory_order_relaxed;
  sched_yield();
  const std::int64_t after = monotonic_now();
  const std::int64_t away = after - now;
  if (away > kTooLong) yield_holdoff_.store(kYieldHoldoff, relaxed);
  quiet_.store(away < kSwitched ? std::min(kQuiet, quiet_.load(relaxed) + 1) : 0, relaxed);
  return after;
}

void Spinner::ended(bool success) noexcept {
  const auto relaxed = std::memory_order_relaxed;
  if (const std::uint32_t left = yield_holdoff_.load(relaxed); left > 0) {
    yield_holdoff_.store(left - 1, relaxed);
  }
  failures_.store(success ? 0 : failures_.load(relaxed) + 1, relaxed);
}

}  // namespace o80
