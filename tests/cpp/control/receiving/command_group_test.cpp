// One command for several actuators: one record, one status, one start, one number of iterations.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "control/rig.hpp"

namespace o80::test {
namespace {

using ::testing::ElementsAre;

/// Adds a group to a rig's batch: one target for each of these actuators.
std::uint32_t add_group(Rig& rig, const std::vector<std::uint32_t>& actuators, RecordHead head,
                        const std::vector<double>& targets, std::uint32_t rows = 1,
                        const std::vector<std::int64_t>& times = {}) {
  std::vector<BatchBuilder::Member> members;
  for (std::size_t i = 0; i < actuators.size(); ++i) {
    head.actuator = static_cast<std::uint16_t>(actuators[i]);
    members.push_back(
        {head, {}, std::as_bytes(std::span(targets)).subspan(8 * i * rows, 8 * rows)});
  }
  return rig.batch.group(members, times, rows);
}

std::vector<std::vector<double>> run(Rig& rig, int iterations,
                                     const std::vector<std::uint32_t>& actuators) {
  std::vector<std::vector<double>> rows;
  for (int i = 0; i < iterations; ++i) {
    rig.step();
    rows.emplace_back();
    for (const std::uint32_t actuator : actuators) rows.back().push_back(rig.desired(actuator));
  }
  return rows;
}

// rule C21
TEST(CommandGroup, MovesAllAndTellsOneStatus) {
  Rig rig(plain_robot(3));
  add_group(rig, {0, 2}, over(2), {2.0, 4.0});
  const CommandId batch = rig.pulse();
  EXPECT_THAT(run(rig, 3, {0, 1, 2}),
              ElementsAre(ElementsAre(1, 0, 2), ElementsAre(2, 0, 4), ElementsAre(2, 0, 4)));
  const auto told = rig.witness.of(record_id(batch, 0));
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].status, Status::active);
  EXPECT_EQ(told[0].iteration, 1);
  EXPECT_EQ(told[1].status, Status::completed);
  EXPECT_EQ(told[1].iteration, 2);
  EXPECT_EQ(rig.witness.status(batch + 1), Status::completed);
  EXPECT_TRUE(rig.all_blocks_back());
}

// rule C21
TEST(CommandGroup, TakesTheFastestWayThatAllCanKeep) {
  Schema schema = plain_robot(2);
  for (const std::uint32_t i : {0U, 1U}) {
    schema.actuator(i).limits({.speed = 1.0, .acceleration = 10.0});
  }
  const auto iterations_of = [&](const std::vector<std::uint32_t>& actuators,
                                 const std::vector<double>& targets) {
    Rig rig(schema);
    RecordHead head = paced(Pace::fastest, 0);
    add_group(rig, actuators, head, targets);
    const CommandId batch = rig.pulse();
    while (rig.controller.active()) rig.step();
    EXPECT_EQ(rig.witness.status(record_id(batch, 0)), Status::completed);
    for (std::size_t i = 0; i < actuators.size(); ++i) {
      EXPECT_EQ(rig.desired(actuators[i]), targets[i]);
    }
    return rig.witness.last(record_id(batch, 0)).iteration;
  };
  const Iteration slow = iterations_of({1}, {0.8});
  EXPECT_EQ(iterations_of({0, 1}, {0.1, 0.8}), slow);
  EXPECT_EQ(iterations_of({0, 1}, {0.8, 0.1}), slow);
}

TEST(CommandGroup, DurationsOfItsMembersOweTheSameRounding) {
  Rig rig(plain_robot(2));
  rig.add(0, during(1'400'000), {1.0});  // 1 iteration, 0.4 owed
  rig.add(1, over(1), {1.0});
  add_group(rig, {0, 1}, during(2'200'000), {2.0, 2.0});  // 2.6
  const CommandId batch = rig.pulse();
  rig.run(6);
  EXPECT_EQ(rig.witness.last(record_id(batch, 2)).iteration, 4);
  EXPECT_EQ(rig.desired(0), 2.0);
  EXPECT_EQ(rig.desired(1), 2.0);

  // with times of its own
  std::vector<double> targets;
  for (int i = 0; i < 20; ++i) targets.push_back(i % 10);
  std::vector<std::int64_t> times;
  for (std::int64_t i = 1; i <= 10; ++i) times.push_back(i * 1'700'000);
  add_group(rig, {0, 1}, during(times.back()), targets, 10, times);
  const CommandId timed = rig.pulse();
  const Iteration begun = rig.next;
  rig.run(30);
  EXPECT_EQ(rig.witness.status(record_id(timed, 0)), Status::completed);
  EXPECT_NEAR(static_cast<double>(rig.witness.last(record_id(timed, 0)).iteration - begun + 1),
              17.0, 1.0);
}

// rule C22
TEST(CommandGroup, GoesOnWithoutAMemberThatIsDroppedAndEndsAsThatOneDid) {
  const auto play = [](auto&& drop, Status status) {
    Rig rig(plain_robot(3));
    add_group(rig, {0, 1, 2}, over(5), {5.0, 5.0, 5.0});
    const CommandId batch = rig.pulse();
    rig.run(2);
    drop(rig);
    EXPECT_EQ(rig.witness.status(record_id(batch, 0)), Status::active);
    rig.run(3);
    EXPECT_EQ(rig.desired(0), 5.0);
    EXPECT_EQ(rig.desired(2), 5.0);
    EXPECT_EQ(rig.witness.status(record_id(batch, 0)), status);
    EXPECT_EQ(rig.witness.last(record_id(batch, 0)).iteration, 5) << "when the last one ended";
    rig.run(3);
    EXPECT_TRUE(rig.all_blocks_back());
  };
  play([](Rig& rig) { rig.controller.interrupt(1, 2); }, Status::interrupted);
  play([](Rig& rig) { rig.controller.purge(1, 3); }, Status::purged);
  play(
      [](Rig& rig) {
        rig.add(1, overwriting(over(1)), {1.0});
        rig.pulse();
      },
      Status::overwritten);
}

TEST(CommandGroup, DoesNotWaitForAMemberThatWasDropped) {
  Rig rig(plain_robot(2));
  rig.add(1, over(100), {9.0});
  add_group(rig, {0, 1}, over(2), {2.0, 2.0});
  const CommandId batch = rig.pulse();
  rig.run(3);
  EXPECT_EQ(rig.desired(0), 0.0);
  rig.batch.purge(1);
  rig.pulse();
  rig.run(2);
  EXPECT_EQ(rig.desired(0), 2.0);
  EXPECT_EQ(rig.witness.status(record_id(batch, 1)), Status::purged);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(CommandGroup, TakesAsLongAsTheLimitsOfItsSlowestMember) {
  Schema schema = plain_robot(2);
  schema.actuator(1).limits({.speed = 100.0});
  Rig rig(schema);
  add_group(rig, {0, 1}, over(2), {1.0, 1.0});
  const CommandId batch = rig.pulse();
  rig.run(5);
  EXPECT_EQ(rig.desired(0), 0.5);
  EXPECT_EQ(rig.desired(1), 0.5);
  rig.run(5);
  EXPECT_EQ(rig.desired(0), 1.0);
  EXPECT_EQ(rig.desired(1), 1.0);
  EXPECT_EQ(rig.witness.status(record_id(batch, 0)), Status::completed);
  EXPECT_EQ(rig.witness.last(record_id(batch, 0)).iteration, 10);
  EXPECT_EQ(rig.witness.last(record_id(batch, 0)).reason, Reason::limits);
}

TEST(CommandGroup, IsLateWhenItsMembersAre) {
  Rig rig(plain_robot(2));
  rig.add(0, over(5), {5.0});
  add_group(rig, {0, 1}, until(3), {9.0, 9.0});
  const CommandId batch = rig.pulse();
  rig.run(8);
  EXPECT_EQ(rig.desired(0), 5.0);
  EXPECT_EQ(rig.desired(1), 0.0);
  EXPECT_EQ(rig.witness.last(record_id(batch, 1)).reason, Reason::late);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(CommandGroup, IsInvalidWholeIfOneMemberIs) {
  const auto refused = [](auto&& spoil) {
    Rig rig(plain_robot(2));
    rig.add(0, over(1), {1.0});
    add_group(rig, {0, 1}, over(2), {2.0, 2.0});
    rig.add(1, over(1), {1.0});
    BatchRecord record;
    record.id = 1;
    const auto sealed = rig.batch.seal(record);
    std::vector<Block> blocks(sealed.begin(), sealed.end());
    const auto head = [&](std::size_t block) {
      return reinterpret_cast<RecordHead*>(blocks[block].bytes.data());
    };
    ASSERT_EQ(blocks.size(), 6U);
    spoil(head(2), head(3), head(4));
    const BlockIndex first = rig.place(blocks);
    while (!rig.check(0, first, 1)) {
    }
    rig.controller.take(0, first, rig);
    rig.run(5);
    EXPECT_EQ(rig.witness.last(record_id(1, 1)).reason, Reason::invalid);
    EXPECT_EQ(rig.witness.ends_of(record_id(1, 0)), 1U);
    EXPECT_EQ(rig.witness.ends_of(record_id(1, 2)), 1U);
    EXPECT_EQ(rig.desired(0), 1.0);
    EXPECT_TRUE(rig.all_blocks_back());
  };
  using Head = RecordHead*;
  refused([](Head, Head, Head second) { second->actuator = 0; });  // twice
  refused([](Head, Head, Head second) { second->actuator = 7; });
  refused([](Head, Head first, Head) { first->mode = Mode::overwrite; });
  refused([](Head, Head first, Head) { first->amount = 3; });
  refused([](Head, Head, Head second) { second->kind = RecordKind::command; });
  refused([](Head, Head, Head second) { second->id = 9; });
  refused([](Head, Head, Head second) { second->payload_bytes = 1 << 20; });
  refused([](Head group, Head, Head) { group->rows = 3; });
  refused([](Head group, Head, Head) { group->rows = 0; });
  refused([](Head group, Head, Head) { group->rows = 1U << 31; });
  refused([](Head group, Head, Head) { group->kind = RecordKind::member; });
}

TEST(CommandGroups, ALaterOfferLeavesTheDelayOfItsMembers) {
  BlockPool pool(1);
  BlockChain chain;
  const Block block{};
  pool.append(chain, &block);
  RecordHead member;
  member.id = kMemberMark | chain.first;
  CommandGroups groups(pool);
  groups.begin(chain.first);
  groups.at(chain.first).decided = 1;
  groups.note_late(chain.first, 3);

  groups.offer(member, CommandGroups::Offer::iterations, 116, 5);

  EXPECT_EQ(groups.late(chain.first), 3);
}

}  // namespace
}  // namespace o80::test
