// One command for several actuators: one record, one status, one start, one number of iterations.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "control/rig.hpp"

namespace o80::test {
namespace {

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

/// What is sent to several again arrives with the slowest one; what is sent to one does not.
// rule C15
TEST(CommandGroup, OnlyAnEqualGroupKeepsTheTimeOfItsSetPoint) {
  Schema schema = plain_robot(2);
  schema.actuator(0).limits({.speed = 1.0, .acceleration = 10.0});
  const auto last_end = [&](const RecordHead& head, int groups, int all) {
    Rig rig(schema);
    CommandId batch = 0;
    for (int i = 0; i < all; ++i) {
      if (i < groups) {
        add_group(rig, {0, 1}, head, {0.1, 0.1});
      } else {
        rig.add(1, head, {0.1});
      }
      batch = rig.pulse();
      rig.step();
    }
    while (rig.controller.active()) rig.step();
    EXPECT_EQ(rig.desired(1), 0.1);
    return rig.witness.last(record_id(batch, 0)).iteration;
  };
  for (const RecordHead& head : {direct(), overwriting(direct())}) {
    EXPECT_EQ(last_end(head, 3, 4), 4);
    EXPECT_EQ(last_end(head, 4, 4), last_end(head, 1, 1));
  }
}

TEST(CommandGroup, IsInvalidWholeIfOneMemberIs) {
  const auto refused = [](auto&& spoil) {
    Rig rig(plain_robot(2));
    rig.add(0, over(1), {1.0});
    add_group(rig, {0, 1}, over(2), {2.0, 2.0});
    rig.add(1, over(1), {1.0});
    std::vector<Block> blocks = rig.sealed();
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
