#include "memory/segment/liveness.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <thread>

#include "memory/child_process.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segments.hpp"

namespace o80 {
namespace {

using LivenessTest = SegmentTest;

TEST_F(LivenessTest, KnowsWhetherALaneWasTakenAndClosedInOrder) {
  const OwnedSegment segment = running_segment();
  LaneLiveness liveness(segment);
  EXPECT_EQ(liveness.lane(0).state, LaneState::free);
  EXPECT_EQ(liveness.changes(), 0U);
  const AttachedSegment attached = attach();
  {
    const LaneSender sender(attached);
    liveness.refresh();
    EXPECT_EQ(liveness.lane(0), (LaneLife{LaneState::alive, 1}));
    EXPECT_EQ(liveness.lane(1).state, LaneState::free);
  }
  liveness.refresh();
  EXPECT_EQ(liveness.lane(0), (LaneLife{LaneState::closed, 1}));
  EXPECT_EQ(liveness.changes(), 2U);
}

TEST_F(LivenessTest, AsksTheKernelOnlyAboutLanesThatHaveAnOwner) {
  SegmentSpec spec = small_spec();
  spec.lanes = 8;
  const OwnedSegment segment = running_segment(spec);
  LaneLiveness liveness(segment);
  const std::uint32_t rounds = liveness.rounds();
  while (liveness.rounds() < rounds + 3) std::this_thread::yield();
  EXPECT_EQ(liveness.queries(), 0U) << "nobody ever owned a lane";

  // while there is an owner, about its lane in each round; once more when it is gone
  const AttachedSegment attached = attach();
  std::optional<LaneSender> sender(attached);
  while (liveness.lane(0).state != LaneState::alive) std::this_thread::yield();
  EXPECT_LE(liveness.queries(), liveness.rounds());
  sender.reset();
  while (liveness.lane(0).state != LaneState::closed) std::this_thread::yield();
  const std::uint64_t requested = liveness.queries();
  const std::uint32_t closed = liveness.rounds();
  while (liveness.rounds() < closed + 3) std::this_thread::yield();
  EXPECT_EQ(liveness.queries(), requested) << "nobody owns a lane any more";
}

TEST_F(LivenessTest, NoticesThatANameLeadsElsewhereAndNotThatABackendHasEnded) {
  for (const bool commanders : {false, true}) {
    const OwnedSegment segment = running_segment();
    const LaneLiveness liveness(segment);
    EXPECT_FALSE(liveness.nameless());
    const std::string path = segment.names().names[commanders ? 1 : 0].path;
    std::filesystem::rename(path, path + ".away");
    while (!liveness.nameless()) std::this_thread::yield();
    std::filesystem::remove(path + ".away");
  }
  OwnedSegment ended = running_segment();
  const LaneLiveness liveness(ended);
  ended.end_and_remove();
  const std::uint32_t rounds = liveness.rounds();
  while (liveness.rounds() < rounds + 10) std::this_thread::yield();
  EXPECT_FALSE(liveness.nameless());
}

TEST_F(LivenessTest, SeesTheDeathOfAnOwnerAndTheLifeOfTheNext) {
  const OwnedSegment segment = running_segment();
  StandingProcess owner([](const StandingProcess::Stand& stand) {
    const AttachedSegment attached = attach();
    const LaneSender sender(attached);
    stand();
  });
  LaneLiveness liveness(segment);
  EXPECT_EQ(liveness.lane(0), (LaneLife{LaneState::alive, 1}));

  owner.kill_now();
  liveness.refresh();
  EXPECT_EQ(liveness.lane(0), (LaneLife{LaneState::died, 1}));

  const AttachedSegment attached = attach();
  const LaneSender next(attached);
  liveness.refresh();
  EXPECT_EQ(liveness.lane(0), (LaneLife{LaneState::alive, 2}));
}

TEST_F(LivenessTest, LeavesALaneToAnOwnerThatIsOnlyStopped) {
  const OwnedSegment segment = running_segment();
  StandingProcess owner([](const StandingProcess::Stand& stand) {
    const AttachedSegment attached = attach();
    const LaneSender sender(attached);
    stand();
  });
  owner.stop_and_wait_until_stopped();
  LaneLiveness liveness(segment);
  EXPECT_EQ(liveness.lane(0).state, LaneState::alive);
  const AttachedSegment attached = attach();
  EXPECT_EQ(LaneSender(attached).lane(), 1U);
}

TEST_F(LivenessTest, ServesManyBackendsOfAProcessThatComeAndGo) {
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int i = 0; i < 4; ++i)
    threads.emplace_back([i] {
      for (int round = 0; round < 5; ++round) {
        const std::string name = "arm" + std::to_string(i);
        const OwnedSegment segment = running_segment(small_spec(name));
        LaneLiveness liveness(segment);
        const AttachedSegment attached = attach(name);
        const LaneSender sender(attached);
        liveness.refresh();
        EXPECT_EQ(liveness.lane(0).state, LaneState::alive);
      }
    });
  for (std::thread& thread : threads) thread.join();
}

TEST_F(LivenessTest, AcceptsAnyProcessorsToAvoid) {
  const OwnedSegment segment = running_segment();
  const LaneLiveness liveness(segment);
  std::vector<int> all;
  for (int i = -1; i < 2000; ++i) all.push_back(i);
  LaneLiveness::avoid_processors({0});
  LaneLiveness::avoid_processors(all);
  LaneLiveness::avoid_processors({});
  const AttachedSegment attached = attach();
  const LaneSender sender(attached);
  while (liveness.lane(0).state != LaneState::alive) std::this_thread::yield();
}

}  // namespace
}  // namespace o80
