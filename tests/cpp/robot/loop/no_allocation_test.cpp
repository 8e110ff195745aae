// No memory is taken from the heap by a burst of a group, in whichever of its threads.
// tests/cpp/iteration looks at everything that an iteration calls.

#include <atomic>
#include <cstdlib>
#include <new>

#include "robot/fake_simulator.hpp"
#include "robot/loop/loop.hpp"

namespace {

std::atomic<bool> counting{false};
std::atomic<long> taken{0};

}  // namespace

// clang's thread sanitizer brings operators of its own, which nobody may replace
#ifndef O80_TEST_THREAD_SANITIZED
__attribute__((noinline)) void* operator new(std::size_t size) {
  if (counting.load(std::memory_order_relaxed)) ++taken;
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
__attribute__((noinline)) void operator delete(void* memory) noexcept { std::free(memory); }
__attribute__((noinline)) void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
#endif

namespace o80::test {
namespace {

class AllocationTest : public FakeDriverTest {};

TEST_F(AllocationTest, TheCountCounts) {
#ifdef O80_TEST_THREAD_SANITIZED
  GTEST_SKIP() << "nothing is counted under the thread sanitizer";
#endif
  taken = 0;
  counting = true;
  std::vector<int> some(100);
  counting = false;
  EXPECT_EQ(some.size(), 100U);
  EXPECT_GE(taken, 1);
}

TEST_F(AllocationTest, ABurstOfAGroupTakesNothingInAnyOfItsThreads) {
  for (const std::size_t threads : {1U, 3U}) {
    InlineGroup group(fake(), {},
                      {.copies = 6, .threads = threads, .backend = InlineGroup::default_options()});
    GroupBurst burst(group, 2, 3, 9);
    burst.plan.command.pace = iterations(3);
    std::vector<float> observations(6);
    std::vector<std::uint8_t> flags(6);
    const RowNumber number{.at = group.description().layout.observed, .kind = Kind::float64};
    group.gather({.numbers = {{.from = number}}, .flags = {{.from = number}}},
                 {observations, flags});
    const KeepWaiting keep_waiting = [] { return true; };
    // until queues that keep their memory have had their largest size
    for (int i = 0; i < 400; ++i) group.burst(burst.plan, burst.all, kPatience, keep_waiting);
    taken = 0;
    counting = true;
    for (int i = 0; i < 1000; ++i) group.burst(burst.plan, burst.all, kPatience, keep_waiting);
    counting = false;
    EXPECT_EQ(taken, 0) << threads << " threads";
  }
}

}  // namespace
}  // namespace o80::test
