#include "runtime/backend/schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace o80 {
namespace {

TEST(Schedule, GivesTheEarliestFirstAndThoseOfOneIterationInTheOrderOfTheirPulses) {
  std::vector<StagedBatch> batches;
  for (std::uint64_t ticket = 0; ticket < 200; ++ticket) {
    batches.push_back({.at = static_cast<Iteration>(ticket * 7919 % 13), .ticket = ticket});
  }
  std::mt19937 random(3);  // NOLINT(bugprone-random-generator-seed)
  std::ranges::shuffle(batches, random);
  Schedule schedule(1);
  for (const StagedBatch& batch : batches) schedule.add(batch);

  std::ranges::sort(batches, [](const StagedBatch& a, const StagedBatch& b) {
    return a.at != b.at ? a.at < b.at : a.ticket < b.ticket;
  });
  for (const StagedBatch& batch : batches) {
    ASSERT_FALSE(schedule.empty());
    EXPECT_EQ(schedule.next().at, batch.at);
    EXPECT_EQ(schedule.next().ticket, batch.ticket);
    schedule.drop_next();
  }
  EXPECT_TRUE(schedule.empty());
}

TEST(Schedule, SetsAsideWhatASilentSenderHasThereAndKeepsTheOthersInOrder) {
  Schedule schedule(2);
  constexpr std::uint32_t kEach = kMaxScheduled;
  for (std::uint32_t i = 0; i < kEach; ++i) {
    const auto at = static_cast<Iteration>(i * 7919 % kEach);
    for (const std::uint32_t lane : {0U, 1U}) {
      schedule.add({.at = at, .ticket = 2 * i + lane, .lane = lane});
    }
  }
  schedule.set_aside_of_silent(1);
  for (Iteration at = 0; at < kEach; ++at) {
    ASSERT_FALSE(schedule.empty());
    EXPECT_EQ(schedule.next().at, at);
    EXPECT_EQ(schedule.next().lane, 0U);
    schedule.drop_next();
  }
  EXPECT_TRUE(schedule.empty());
  for (std::uint32_t i = 0; i < kEach; ++i) {
    ASSERT_TRUE(schedule.has_aside());
    const StagedBatch batch = schedule.take_aside();
    EXPECT_EQ(batch.lane, 1U);
    EXPECT_TRUE(batch.silent);
  }
  EXPECT_FALSE(schedule.has_aside());
  EXPECT_TRUE(schedule.has_room(1, 0));
}

}  // namespace
}  // namespace o80
