#include <gtest/gtest.h>

#include "control/rig.hpp"
#include "count_allocations.hpp"

namespace o80::test {
namespace {

TEST(Controller, AllocatesNothingOnceItIsMade) {
  Schema schema = plain_robot(8, 2);
  schema.actuator(0).limits({.minimum = -1.0, .maximum = 1.0, .speed = 5.0});
  schema.actuator(1).when_idle(WhenIdle::follow);
  const Limits arm{.speed = 2.0, .acceleration = 15.0, .jerk = 500.0};
  schema.actuator(5).limits("x0", arm).limits("x1", arm);
  schema.add_request("nothing", kNoType, "no payload");
  Rig rig(schema, 20'000);
  rig.witness.keep = false;
  rig.requests.reserve(10);
  rig.controls.reserve(10);

  for (std::uint32_t actuator = 0; actuator < 8; ++actuator) {
    rig.add(actuator, over(20), {2.0, 2.0});
    rig.add(actuator, smoothly(at_speed(100.0)), {1.0, 2.0});
    rig.add(actuator, during(3'500'000), {1.5, 2.0});
    rig.add_rows(actuator, during(0), 2, {1.0, 2.0, 3.0, 4.0}, {2'000'000, 5'000'000});
    rig.add_rows(actuator, over(2), 2, {1.0, 2.0, 3.0, 4.0}, {}, {0b10});
    rig.add(actuator, until(2), {1.0, 2.0});
    for (int i = 0; i < 500; ++i) rig.add(actuator, direct(), {1.0, 1.0});
  }
  rig.batch.request(0, {});
  rig.batch.take_control();
  rig.add(0, over(100), {0.0, 0.0});
  const BlockIndex first = rig.send(0);
  rig.add(2, overwriting(smoothly(over(100))), {0.0, 0.0});
  rig.add(5, overwriting(paced(Pace::fastest, 0)), {1.0, 0.5});
  rig.add(6, overwriting(smoothly(over(100))), {0.0, 0.0});
  rig.batch.purge_own(3);
  const BlockIndex second = rig.send(1);
  for (int i = 0; i < 2000; ++i) rig.add(0, over(5), {0.0, 0.0});
  const BlockIndex third = rig.send(1);

  const std::size_t before = allocations;
  while (!rig.check(0, first, 1024)) {
  }
  rig.controller.take(0, first, rig);
  for (int i = 0; i < 100; ++i) rig.step();
  rig.controller.take(1, second, rig);
  rig.controller.reject(1, third, Reason::late, 0, 3);
  for (int i = 0; i < 100; ++i) rig.step();
  rig.controller.interrupt(4, rig.next);
  rig.controller.purge_lane(0, kEveryActuator, rig.next, Reason::dead_frontend);
  rig.controller.restart(rig.observed.data(), nullptr, rig.next);
  for (int i = 0; i < 10; ++i) rig.step();
  EXPECT_EQ(allocations - before, 0U);

  EXPECT_FALSE(rig.controller.pending());
  EXPECT_TRUE(rig.all_blocks_back());
  EXPECT_GT(rig.witness.told, 6000U);
}

TEST(Controller, TheCountOfAllocationsCounts) {
#ifdef O80_TEST_THREAD_SANITIZED
  GTEST_SKIP() << "nothing is counted under the thread sanitizer";
#endif
  const std::size_t before = allocations;
  {
    const BlockPool plain(4);
  }
  const std::size_t between = allocations;
  EXPECT_GT(between, before);
  {
    const std::vector<Block> aligned(2);
    EXPECT_GT(allocations, between) << aligned.size();
  }
}

}  // namespace
}  // namespace o80::test
