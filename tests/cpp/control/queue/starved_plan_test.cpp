// Plans of chunks that run out of rows (docs/chunks.md#a-policy-that-hangs).
#include <gtest/gtest.h>

#include <functional>

#include "control/chunk_rig.hpp"

namespace o80::test {
namespace {

// rule K11
TEST(Chunk, APlanIsStarvedFromTheIterationAfterItsLastRowUntilItEndsOrGoesOn) {
  const auto none = [](ChunkRig&) {};
  const auto close = [](ChunkRig& rig, std::uint64_t plan, std::uint32_t lane) {
    rig.batch.close_plan(plan);
    rig.pulse(lane);
  };
  struct Case {
    ChunkHead head;
    std::function<void(ChunkRig&)> at_120, at_155;
    std::vector<Iteration> starved;  // from the first one up to before the second
  };
  const ChunkHead open{.plan = 7, .ease = 10};
  const ChunkHead final{.plan = 7, .ease = 10, .final = 1};
  const std::vector<Case> cases{
      {open, none, none, {151, 200}},
      {final, none, none, {}},
      {open, [&](ChunkRig& rig) { close(rig, 7, 0); }, none, {}},
      {open, [&](ChunkRig& rig) { close(rig, 0, 0); }, none, {}},
      {open, [&](ChunkRig& rig) { close(rig, 8, 0); }, none, {151, 200}},
      {open, [&](ChunkRig& rig) { close(rig, 7, 1); }, none, {151, 200}},
      {open, none, [&](ChunkRig& rig) { close(rig, 7, 0); }, {151, 155}},
      {open,
       none,
       [&](ChunkRig& rig) { rig.example({.anchor = 154, .plan = 7, .final = 1}); },
       {151, 155}},
      {open,
       none,  // it waits, but its rows are ahead
       [&](ChunkRig& rig) { rig.example({.anchor = 170, .plan = 7, .final = 1}); },
       {151, 155}},
      {open,
       none,
       [&](ChunkRig& rig) {
         rig.example({.anchor = 170, .plan = 7});
         close(rig, 7, 0);
       },
       {151, 155}},
      {open,
       none,
       [](ChunkRig& rig) {
         rig.add(0, over(3), {1.0});
         rig.pulse(1);
       },
       {151, 155}},
      {open, none, [](ChunkRig& rig) { rig.controller.purge_lane(0, 0, rig.next); }, {151, 155}},
      {open, none, [](ChunkRig& rig) { rig.controller.purge_lane(1, 0, rig.next); }, {151, 200}},
      {open, none, [](ChunkRig& rig) { rig.controller.halt(rig.next); }, {151, 155}},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Case& each = cases[i];
    ChunkRig rig(plain_robot(2));
    rig.run_to(101);
    rig.example(each.head);
    rig.add(1, over(110), {1.0});  // another one goes on meanwhile
    rig.pulse(2);
    std::vector<Iteration> found;
    bool before = false;
    for (Iteration now = 101; now < 230; ++now) {
      if (now == 120) each.at_120(rig);
      if (now == 155) each.at_155(rig);
      rig.run_to(now + 1);
      if (now < 200 && rig.starved() != before) found.push_back(now);
      before = rig.starved();
      EXPECT_TRUE(!rig.starved() || rig.controller.acts(0)) << "for the watchdog";
    }
    if (found.size() % 2 == 1) found.push_back(200);
    EXPECT_EQ(found, each.starved) << i;
    EXPECT_EQ(rig.controller.starvations(), each.starved.empty() ? 0 : 1) << i;
    EXPECT_EQ(rig.at(150), 0.2) << i;
    EXPECT_EQ(rig.controller.acts(0), rig.starved()) << i;
    EXPECT_EQ(rig.controller.shows_all(), !rig.starved()) << "where a replay may begin";
    EXPECT_TRUE(rig.all_blocks_back());
  }
}

TEST(Chunk, TheEndOfAPlanDoesNotOvertakeItsChunks) {
  BatchBuilder batch;
  batch.purge_own(kEveryActuator);
  const auto is_express = [&] {
    std::uint16_t flags = 0;
    const std::byte* const record = batch.seal(BatchRecord()).front().bytes.data();
    std::memcpy(&flags, record + offsetof(BatchRecord, flags), sizeof flags);
    return (flags & kExpress) != 0;
  };
  EXPECT_TRUE(is_express());
  batch.close_plan(1);
  EXPECT_FALSE(is_express());
  ChunkRig rig;  // nor does it if a sender says so
  rig.batch.close_plan(1);
  const BlockIndex first = rig.send();
  rig.check(0, first, 100);
  EXPECT_EQ(rig.controller.effort(first).express, 0U);
  EXPECT_EQ(rig.controller.effort(first).free, 1U) << "it needs no control";
}

}  // namespace
}  // namespace o80::test
