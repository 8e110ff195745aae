// The bell: a backend that found nothing to do does not sleep while something was committed.
//
// mutant looks_before_it_rings: src/memory/segment/signal.cpp
//   - bell.rung.fetch_add(1, std::memory_order_seq_cst);
//   + const bool sleeps = view.wakes().sleeping.load(std::memory_order_seq_cst) != 0;
//   + bell.rung.fetch_add(1, std::memory_order_seq_cst);
//   - if (view.wakes().sleeping.load(std::memory_order_seq_cst) != 0)
//   + if (sleeps)
// mutant looks_relaxed: src/memory/segment/signal.cpp
//   - if (view.wakes().sleeping.load(std::memory_order_seq_cst) != 0)
//   + if (view.wakes().sleeping.load(std::memory_order_relaxed) != 0)
// mutant sleeps_in_secret: src/memory/segment/signal.cpp
//   - sleeping.store(1, std::memory_order_seq_cst);
//   +

#include "kernel.hpp"

namespace {

constexpr int kCommits = 2;

/// Two ring after each of their commits; the backend looks, and waits for what it has not seen.
struct Bell : rl::test_suite<Bell, 3> {
  model::Segment segment{1, 2, 0, 1};
  std::atomic<int> committed{0};

  void thread(unsigned index) {
    if (index != 0) return ring();
    o80::BellWaiter bell(segment.view);
    while (true) {
      const std::uint32_t seen = bell.value();
      if (committed.load(std::memory_order_relaxed) == 2 * kCommits) return;
      bell.wait(seen);
    }
  }

  void ring() {
    for (int i = 0; i < kCommits; ++i) {
      committed.fetch_add(1, std::memory_order_relaxed);
      o80::ring_bell(segment.view);
    }
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Bell>(count, arguments); }
