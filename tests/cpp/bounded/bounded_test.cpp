// However much a lane holds, an iteration looks at no more than its share of it.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "bounded/counted_work.hpp"
#include "control/chunk_rig.hpp"

namespace o80::test {
namespace {

constexpr std::uint32_t kLane = 16'384;  // blocks
constexpr std::uint32_t kBudget = 1024;  // blocks, and statuses told, in an iteration
/// Of that, and a little for batches, the queues' ends and what runs.
constexpr std::uint32_t kMax = 2 * kBudget + 64;

/// A robot of four joints with two full lanes of work.
class BoundedTest : public ::testing::Test {
 protected:
  BoundedTest() {
    rig.witness.keep = false;
    next_iteration();
  }
  /// Forgets what was seen; gives how many blocks that were.
  static std::uint32_t next_iteration() { return work_since_last_asked().blocks; }

  /// What one iteration has looked at since the last.
  void expect_a_share(const std::string& what) {
    const std::uint32_t seen = next_iteration();
    most = std::max(most, seen);
    EXPECT_LE(seen, kMax) << what;
  }
  /// Iterates until nothing dropped is left to be told.
  void settle(const std::string& what) {
    int iterations = 0;
    do {
      rig.step();
      expect_a_share(what + ", " + std::to_string(iterations) + " iterations later");
    } while (rig.controller.pending() && ++iterations < 100);
    EXPECT_FALSE(rig.controller.pending());
  }
  /// Has a batch checked as it is in the backend, and taken.
  void check_and_take(std::uint32_t lane, BlockIndex batch) {
    next_iteration();
    while (!rig.check(lane, batch, kBudget)) expect_a_share("checking");
    expect_a_share("checking");
    rig.controller.take(lane, batch, rig);
    expect_a_share("taking");
  }
  /// A lane full of single commands in turn for all joints, as a batch or as many.
  void fill(std::uint32_t lane, RecordHead head, std::uint32_t batches = 1) {
    const std::uint32_t commands = (kLane - batches) / batches;
    for (std::uint32_t batch = 0; batch < batches; ++batch) {
      for (std::uint32_t i = 0; i < commands; ++i) rig.add(i % 4, head, {1.0});
      check_and_take(lane, rig.send(lane));
    }
  }
  /// Two lanes whose commands alternate in every queue.
  void fill_two() {
    for (std::uint32_t i = 0; i < kLane / 8; ++i) {
      for (const std::uint32_t lane : {0U, 1U}) {
        for (std::uint32_t joint = 0; joint < 4; ++joint) rig.add(joint, over(1000), {1.0});
        rig.controller.take(lane, rig.send(lane), rig);
      }
    }
    rig.step();
    next_iteration();
  }

  Rig rig{plain_robot(4), 4 * kLane};
  std::uint32_t most = 0;
};

TEST_F(BoundedTest, CheckingAndTakingAFullLaneOfCommands) {
  fill(0, over(1000));
  settle("running");
  EXPECT_GT(most, kBudget / 4) << "the count counts";
}

TEST_F(BoundedTest, CheckingTakingAndBeginningOneTrajectoryThatFillsALane) {
  for (const bool timed : {false, true}) {
    const std::uint32_t rows = (kLane - 2) * 8 / (timed ? 2 : 1);
    std::vector<std::int64_t> times(timed ? rows : 0);
    for (std::uint32_t i = 0; i < times.size(); ++i) times[i] = 2'000'000 * std::int64_t{i + 1};
    std::vector<double> targets(rows);
    for (std::uint32_t i = 0; i < rows; ++i) targets[i] = i;
    rig.add_rows(0, timed ? during(0) : over(2), rows, targets, times);
    const BlockIndex batch = rig.send();
    check_and_take(0, batch);
    rig.step();
    expect_a_share("its first row");
    for (int i = 0; i < 7; ++i) rig.step();
    EXPECT_EQ(rig.desired(0), 3.0) << "two iterations a row";
    rig.controller.purge(kEveryActuator, rig.next);
    expect_a_share("dropping it");
    settle("giving it back");
  }
}

TEST_F(BoundedTest, DroppingTwoFullLanes) {
  const std::vector<std::pair<std::string, std::function<void()>>> ways = {
      {"purging all", [&] { rig.controller.purge(kEveryActuator, rig.next); }},
      {"purging what one lane sent",
       [&] { rig.controller.purge_lane(0, kEveryActuator, rig.next, Reason::dead_frontend); }},
      {"interrupting", [&] { rig.controller.interrupt(kEveryActuator, rig.next); }},
      {"starting afresh", [&] { rig.controller.restart(rig.observed.data(), nullptr, rig.next); }},
      {"a lane's own purge",
       [&] {
         rig.batch.purge_own(kEveryActuator);
         rig.pulse(1);
       }},
      {"overwriting",
       [&] {
         for (std::uint32_t joint = 0; joint < 4; ++joint) {
           rig.add(joint, overwriting(over(2)), {1.0});
         }
         rig.pulse(2);
       }},
  };
  for (const auto& [name, way] : ways) {
    fill_two();
    way();
    expect_a_share(name);
    settle("after " + name);
    rig.controller.purge(kEveryActuator, rig.next);
    expect_a_share("purging the rest after " + name);
    settle("purging the rest");
  }
}

TEST_F(BoundedTest, RejectingAFullLaneAndEndingItsLateCommands) {
  for (std::uint32_t i = 0; i < kLane - 1; ++i) rig.add(i % 4, over(1), {1.0});
  const BlockIndex batch = rig.send();
  next_iteration();
  while (!rig.check(0, batch, kBudget)) expect_a_share("checking");
  next_iteration();
  rig.controller.reject(0, batch, Reason::late, 0, rig.next);
  expect_a_share("rejecting");
  settle("telling it");

  fill(1, until(0));
  settle("late commands in a row");
}

TEST_F(BoundedTest, CheckingGarbage) {
  // a record that claims all the blocks but is no record; one that claims more than there are
  for (const std::uint32_t claimed : {64 * (kLane - 2), 0xFFFF'FFFFU}) {
    for (const std::uint32_t records : {1U, 2U}) {
      std::vector<Block> blocks(kLane);
      BatchRecord batch;
      batch.records = records;
      batch.blocks = kLane;
      batch.id = 1;
      RecordHead head;
      head.kind = RecordKind::command;
      head.pace = static_cast<Pace>(77);
      head.id = record_id(1, 0);
      head.payload_bytes = claimed;
      std::memcpy(blocks[0].bytes.data(), &batch, sizeof batch);
      std::memcpy(blocks[1].bytes.data(), &head, sizeof head);
      check_and_take(0, rig.place(blocks));
      settle("garbage");
      EXPECT_TRUE(rig.all_blocks_back());
    }
  }
  // a batch of which no record uses most
  std::vector<Block> blocks(kLane);
  BatchRecord batch;
  batch.blocks = kLane;
  batch.id = 1;
  std::memcpy(blocks[0].bytes.data(), &batch, sizeof batch);
  check_and_take(0, rig.place(blocks));
  EXPECT_TRUE(rig.all_blocks_back());
}

/// Looks at blocks while a chunk is taken and begins, so many of its rows being late.
std::uint32_t visits_of_a_chunk(std::uint32_t rows, std::uint32_t late) {
  ChunkRig rig(plain_robot(1), kLane);
  rig.run_to(2000);
  const ChunkHead chunk{.anchor = rig.next - 1 - Iteration{late}, .ease = 1, .fixed = 1};
  rig.add_chunk(std::vector(rows, 1.0), every(1, rows), chunk, Profile::linear);
  const BlockIndex batch = rig.send();
  while (!rig.check(0, batch, kBudget)) {
  }
  work_since_last_asked();
  rig.controller.take(0, batch, rig);
  rig.step();
  const std::uint32_t visits = work_since_last_asked().visits;
  EXPECT_EQ(rig.desired(), 1.0) << rows << " rows, " << late << " late";
  return visits;
}

TEST(BoundedChunk, TakingItLooksAtNearlyAsManyBlocksHoweverManyRowsItHasOrAreLate) {
  constexpr std::uint32_t kOfASearch = 3;  // the note of a row: its list, the place in it, the note
  const auto searched = [](std::uint32_t rows) {
    std::uint32_t steps = 0;
    for (std::uint32_t notes = (rows + RowNote::kRows - 1) / RowNote::kRows; notes > 1; ++steps) {
      notes -= notes / 2;
    }
    return steps * kOfASearch;
  };
  const std::uint32_t few = visits_of_a_chunk(1, 0);
  EXPECT_GT(few, 10U) << "the count counts";
  // two searches: for late rows, and for the first that is reached; and the row after that
  EXPECT_LE(visits_of_a_chunk(2000, 0), few + 2 * searched(2000) + 4);
  const std::uint32_t in_time = visits_of_a_chunk(1000, 0);
  const std::uint32_t late = visits_of_a_chunk(1000, 999);
  EXPECT_LE(std::max(late, in_time), std::min(late, in_time) + 2 * kOfASearch);
}

/// However many numbers a state has, a share of the budget is what it says, and so is a begin.
TEST(BoundedChunk, CheckingAndBeginningLargeStatesLooksAtEachBlockAFewTimes) {
  constexpr std::uint32_t kNumbers = 800;
  constexpr std::uint32_t kRows = 24;
  ChunkRig rig(plain_robot(1, kNumbers), kLane);
  rig.add_chunk(std::vector(kRows * kNumbers, 1.0), every(2, kRows), {.anchor = 0, .ease = 1},
                Profile::linear);
  const BlockIndex batch = rig.send();
  work_since_last_asked();
  constexpr std::uint32_t kShare = 256;
  for (bool done = false; !done;) {
    done = rig.check(0, batch, kShare);
    // of the row, or the notes, with which the budget ends
    EXPECT_LE(work_since_last_asked().visits, 3 * kShare + 2 * kNumbers);
  }
  rig.controller.take(0, batch, rig);
  rig.step();
  EXPECT_LE(work_since_last_asked().visits, 6 * kNumbers);
  rig.step();
  EXPECT_EQ(rig.desired(kNumbers - 1), 1.0);
}

}  // namespace
}  // namespace o80::test
