// No memory is taken from the heap in an iteration.

#include <atomic>
#include <cstdlib>
#include <new>

#include "robot/drifter.hpp"
#include "robot/loop/loop.hpp"
#include "robot/puppet.hpp"

namespace {

thread_local bool counting = false;
thread_local long taken = 0;
std::atomic<bool> counting_everywhere{false};
std::atomic<long> taken_everywhere{0};

}  // namespace

// clang's thread sanitizer brings operators of its own, which nobody may replace
#ifndef O80_TEST_THREAD_SANITIZED
__attribute__((noinline)) void* operator new(std::size_t size) {
  if (counting) ++taken;
  if (counting_everywhere.load(std::memory_order_relaxed)) ++taken_everywhere;
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

class AllocationTest : public PuppetTest {};

/// Counts what this thread takes from the heap while it lives.
class Counting {
 public:
  Counting() {
    taken = 0;
    counting = true;
  }
  Counting(const Counting&) = delete;
  Counting& operator=(const Counting&) = delete;
  ~Counting() { counting = false; }
};

TEST_F(AllocationTest, TheCountCounts) {
#ifdef O80_TEST_THREAD_SANITIZED
  GTEST_SKIP() << "nothing is counted under the thread sanitizer";
#endif
  const Counting count;
  std::vector<int> some(100);
  EXPECT_EQ(some.size(), 100U);
  EXPECT_GE(taken, 1);
}

TEST_F(AllocationTest, AnIterationTakesNothingWithCommandsRequestsBurstsAndWaiters) {
  Loop loop(std::make_unique<DriverInstance>(table(), OptionValues{}),
            {.segment = "puppet", .bursting = true, .lane_blocks = 4096});
  loop.start();
  UntypedFrontend one("puppet");
  UntypedFrontend two("puppet");

  // somebody waits for every row
  std::atomic<bool> done{false};
  std::thread waiter([&] {
    const UntypedFrontend reader("puppet");
    UntypedObservation row(reader.description());
    Iteration position = 0;
    while (!done) {
      try {
        reader.wait_for_next(position, row.bytes(), std::chrono::milliseconds(10));
      } catch (const TimeoutError&) {
        continue;  // it stands still
      }
    }
  });
  long total = 0;
  Puppet::on_read = [](Reading<Puppet>& reading) {
    if (reading.iteration() % 17 == 0) reading.interrupt(1);
    reading.progress<Poke>(reading.iteration() % 2 == 0 ? "one way" : "the other way");
    if (reading.iteration() % 5 == 0) {
      reading.ended<Poke>(reading.iteration() % 2 == 0 ? Served::start_afresh()
                                                       : Served::rejected("not now"));
    }
  };
  for (int round = 0; round < 200; ++round) {
    // a batch that is larger than an iteration takes, rejected ones, dropped ones, requests
    for (int i = 0; i < (round % 20 == 0 ? 1500 : 3); ++i) {
      add(one, 0, i, {.pace = iterations(2), .mode = i == 1 ? Mode::overwrite : Mode::queue});
    }
    add(one, 1, round, {.pace = until(round)});
    add_request(one, Poke{static_cast<std::uint32_t>(round % 3)});
    add_request(one, Poke{.how = 5});
    one.pulse();
    add(two, 1, 0.5 * round,
        {.pace = duration(std::chrono::milliseconds(3)), .profile = Profile::minimum_jerk});
    two.pulse({.at = round % 7 == 0 ? 1 : 5 * round});
    two.add_take_control();
    two.add_release_control();
    if (round % 5 == 0) two.add_purge();
    const Burst burst = two.start_burst(3);
    Step step = Step::run;
    {
      const Counting count;
      step = loop.run_granted(kAll);
      counting = false;
      total += taken;
    }
    ASSERT_EQ(step, Step::standing);
    ASSERT_TRUE(burst.done());
  }
  done = true;
  waiter.join();
  EXPECT_EQ(total, 0);
}

TEST_F(AllocationTest, ABurstOfAGroupTakesNothingInAnyOfItsThreads) {
  for (const std::size_t threads : {1U, 3U}) {
    InlineGroup group(drifter(), {},
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
    taken_everywhere = 0;
    counting_everywhere = true;
    for (int i = 0; i < 1000; ++i) group.burst(burst.plan, burst.all, kPatience, keep_waiting);
    counting_everywhere = false;
    EXPECT_EQ(taken_everywhere, 0) << threads << " threads";
  }
}

}  // namespace
}  // namespace o80::test
