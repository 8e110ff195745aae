#include "o80/runtime/schedule.hpp"

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

}  // namespace
}  // namespace o80
