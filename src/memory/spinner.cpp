#include "o80/memory/spinner.hpp"

#include <sched.h>

namespace o80 {

namespace {

int usable_processors() noexcept {
  cpu_set_t processors;
  return sched_getaffinity(0, sizeof processors, &processors) == 0 ? CPU_COUNT(&processors) : 2;
}

}  // namespace

Spinner::Spinner() noexcept : Spinner(0) {}

bool Spinner::worth() noexcept {
  const auto relaxed = std::memory_order_relaxed;
  const std::uint32_t refused = refused_.load(relaxed);
  const bool probe = refused + 1 >= kProbe;

  // a thread may be pinned after its objects were made: each probe looks again
  if (fixed_ == 0 && (probe || processors_.load(relaxed) == 0))
    processors_.store(usable_processors(), relaxed);
  const int processors = fixed_ > 0 ? fixed_ : processors_.load(relaxed);

  const bool hopeful = failures_.load(relaxed) < kPatience;
  const bool spins = processors > 1 && (hopeful || probe);
  refused_.store(spins || probe ? 0 : refused + 1, relaxed);
  return spins;
}

void Spinner::ended(bool success) noexcept {
  const auto relaxed = std::memory_order_relaxed;
  failures_.store(success ? 0 : failures_.load(relaxed) + 1, relaxed);
}

}  // namespace o80
