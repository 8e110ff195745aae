// No memory is taken from the heap by a burst of a group, in whichever of its threads.
// tests/cpp/iteration looks at everything that an iteration calls.

#include "count_allocations.hpp"
#include "robot/fake_simulator.hpp"
#include "robot/loop/loop.hpp"

namespace o80::test {
namespace {

class AllocationTest : public FakeDriverTest {};

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
    const std::size_t before = allocations_of_all;
    for (int i = 0; i < 1000; ++i) group.burst(burst.plan, burst.all, kPatience, keep_waiting);
    EXPECT_EQ(allocations_of_all, before) << threads << " threads";
    EXPECT_EQ(before > 0, kAllocationsAreCounted) << "the count counts";
  }
}

}  // namespace
}  // namespace o80::test
