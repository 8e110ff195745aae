#include "control/queue/controller.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "control/rig.hpp"
#include "o80/base/error.hpp"

namespace o80::test {
namespace {

using testing::ElementsAre;

Schema robot_with_requests() {
  Schema schema = plain_robot(2);
  const auto home = schema.add_type("Home", {scalar_field("speed", Kind::float64)});
  schema.add_request("home", home, "go home");
  schema.add_request("nothing", kNoType, "no payload");
  return schema;
}

TEST(Controller, ADeadFrontendIsPurgedWhateverItShares) {
  Rig rig(plain_robot(1));
  for (std::uint32_t lane : {0, 1, 0, 2, 0}) {
    rig.add(0, over(2), {1.0 + lane});
    rig.pulse(lane);
  }
  rig.step();
  rig.controller.purge_lane(0, kEveryActuator, rig.next, Reason::dead_frontend);
  EXPECT_THAT(rig.run(5), ElementsAre(1.25, 2.0, 2.5, 3.0, 3.0));
  EXPECT_EQ(rig.witness.last(3, 0).reason, Reason::dead_frontend);
  EXPECT_EQ(rig.witness.last(3, 0).iteration, 2);
  EXPECT_TRUE(rig.all_blocks_back());
  EXPECT_EQ(rig.witness.freed_blocks[0], 6U);
  EXPECT_EQ(rig.witness.freed_blocks[1], 2U);
}

TEST(Controller, AnEmptyBatchIsCompletedAtOnce) {
  Rig rig(plain_robot(1));
  const CommandId batch = rig.pulse();
  EXPECT_EQ(rig.witness.status(batch), Status::active);
  EXPECT_EQ(rig.witness.status(batch + 1), Status::completed);
  EXPECT_EQ(rig.witness.last(batch + 1).iteration, 1);
  EXPECT_EQ(rig.witness.freed_blocks[0], 1U);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(Controller, ARejectedBatchEndsWithAllItsRecords) {
  Rig rig(robot_with_requests());
  rig.add(0, over(5), {1.0});
  rig.batch.request(1, {});
  rig.batch.purge(0);
  const std::uint64_t blocks = rig.batch.blocks();
  const BlockIndex first = rig.send(3);
  rig.controller.reject(3, first, Reason::exclusive, 5, 7);
  EXPECT_EQ(rig.witness.status(rig.sent, 3), Status::rejected) << "told at once";
  while (!rig.controller.finish_pending()) {
  }
  for (CommandId id = rig.sent; id < rig.sent + 5; ++id) {
    ASSERT_EQ(rig.witness.of(id, 3).size(), 1U);
    EXPECT_EQ(rig.witness.last(id, 3).status, Status::rejected);
    EXPECT_EQ(rig.witness.last(id, 3).reason, Reason::exclusive);
    EXPECT_EQ(rig.witness.last(id, 3).detail, 5);
    EXPECT_EQ(rig.witness.last(id, 3).iteration, 7);
  }
  EXPECT_EQ(rig.witness.freed_blocks[3], blocks);
  EXPECT_TRUE(rig.all_blocks_back());
  EXPECT_TRUE(rig.requests.empty());
}

TEST(Controller, ABatchMayBeRejectedAfterItWasChecked) {
  Rig rig(plain_robot(1));
  for (int i = 0; i < 10; ++i) rig.add(0, over(5), {1.0});
  const BlockIndex half = rig.send();
  EXPECT_FALSE(rig.check(0, half, 3));
  rig.controller.reject(0, half, Reason::late, 0, 7);
  rig.controller.finish_pending();
  for (int i = 0; i < 10; ++i) rig.add(0, over(5), {1.0});
  const BlockIndex whole = rig.send();
  EXPECT_TRUE(rig.check(0, whole, 100));
  rig.controller.reject(0, whole, Reason::late, 0, 7);
  rig.controller.finish_pending();
  EXPECT_TRUE(rig.all_blocks_back());
  EXPECT_EQ(rig.witness.changes.size(), 24U);
}

// rule B9
TEST(Controller, RequestsAreServedInOrderWithTheBatch) {
  Rig rig(robot_with_requests());
  rig.add(0, over(2), {1.0});
  rig.batch.request(0, bytes_of_one(2.5));
  rig.batch.take_control();
  rig.batch.release_control();
  rig.batch.request(1, {});
  const CommandId batch = rig.pulse(2);
  ASSERT_EQ(rig.requests.size(), 2U);
  EXPECT_EQ(rig.requests[0].lane, 2U);
  EXPECT_EQ(rig.requests[0].id, batch + 3);
  EXPECT_EQ(rig.requests[0].index, 0U);
  EXPECT_EQ(rig.requests[0].bytes, 8U);
  EXPECT_EQ(rig.requests[1].index, 1U);
  EXPECT_THAT(rig.controls, ElementsAre(std::pair(2U, true), std::pair(2U, false)));
  EXPECT_EQ(rig.witness.status(batch + 3, 2), Status::completed);
  EXPECT_EQ(rig.witness.status(batch + 1, 2), Status::none);
  rig.run(2);
  EXPECT_EQ(rig.witness.status(batch + 1, 2), Status::completed);
}

TEST(Controller, ARestoredStartTakesTheDesiredStateItIsGiven) {
  Rig rig(plain_robot(1));
  rig.observe(0, 1.0);
  const double desired = 3.0;
  rig.controller.restart(rig.observed.data(), reinterpret_cast<const std::byte*>(&desired), 9);
  EXPECT_EQ(rig.desired(), 3.0);
  EXPECT_THAT(rig.run(1), ElementsAre(3.0));
}

TEST(Controller, DroppingALongQueueTellsAThousandStatusesAnIterationEachOfTheDrop) {
  Rig rig(plain_robot(1), 10'000);
  for (int i = 0; i < 5000; ++i) rig.add(0, over(5), {1.0});
  const CommandId batch = rig.pulse();
  rig.step();
  rig.controller.purge(kEveryActuator, rig.next);
  rig.witness.changes.clear();
  for (int iteration = 0; iteration < 4; ++iteration) {
    const std::size_t before = rig.witness.changes.size();
    rig.step();
    EXPECT_EQ(rig.witness.changes.size() - before, Controller::kStatusesPerIteration);
    EXPECT_TRUE(rig.controller.pending());
  }
  rig.step();
  EXPECT_FALSE(rig.controller.pending());
  ASSERT_EQ(rig.witness.changes.size(), 5001U);
  for (const StatusChange& change : rig.witness.changes) EXPECT_EQ(change.iteration, 2);
  EXPECT_EQ(rig.witness.changes.back().id, batch + 1);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(Controller, BlocksAreGivenBackAsSoonAsTheirRecordEnds) {
  Rig rig(plain_robot(1));
  rig.add_rows(0, direct(), 20, std::vector<double>(20));
  rig.add(0, over(5), {1.0});
  rig.pulse(1);
  rig.run(20);
  EXPECT_EQ(rig.witness.freed_blocks[1], 4U) << "48 + 160 bytes";
  rig.run(5);
  EXPECT_EQ(rig.witness.freed_blocks[1], 6U) << "the batch's own included";
  EXPECT_EQ(rig.witness.freed_blocks[0], 0U);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(Controller, ARobotWithoutActuatorsIteratesAndServesRequests) {
  Schema schema;
  schema.head.period = kMillisecond;
  schema.add_request("nothing", kNoType, "no payload");
  Rig rig(schema);
  rig.batch.request(0, {});
  rig.batch.purge(kEveryActuator);
  const CommandId batch = rig.pulse();
  rig.run(0);
  rig.step();
  EXPECT_EQ(rig.witness.status(batch + 1), Status::completed);
  EXPECT_FALSE(rig.controller.active());
}

TEST(Controller, ManyActuatorsEachHaveTheirOwnQueue) {
  Rig rig(plain_robot(130));
  for (std::uint32_t i = 0; i < 130; i += 3) rig.add(i, over(1 + i), {1.0 + i});
  rig.pulse();
  for (int iteration = 1; iteration <= 130; ++iteration) {
    rig.step();
    for (std::uint32_t i = 0; i < 130; ++i) {
      const bool commanded = i % 3 == 0;
      ASSERT_EQ(rig.active(i), commanded && iteration <= static_cast<int>(i) + 1);
      ASSERT_DOUBLE_EQ(rig.desired(i), commanded ? std::min<double>(iteration, 1.0 + i) : 0.0);
    }
  }
}

TEST(Controller, AStateWithoutNumbersIsRefusedWhenTheControllerIsMade) {
  Schema schema;
  schema.add_actuators("joint", schema.add_type("Empty", {}), 1);
  BlockPool pool(8);
  Witness witness;
  EXPECT_THROW(Controller(schema, pool, witness), InvalidArgument);
}

}  // namespace
}  // namespace o80::test
