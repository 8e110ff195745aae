#include "runtime/frontend/ids_in_flight.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

namespace o80 {
namespace {

constexpr std::uint64_t kPlaces = 32;
const IdsInFlight::HasEnded kAll = [](CommandId) { return true; };
const IdsInFlight::HasEnded kNone = [](CommandId) { return false; };

TEST(IdsInFlight, FollowEachOtherWhileNothingComesRound) {
  IdsInFlight ids(kPlaces);
  EXPECT_EQ(ids.draw(1, 10, kNone), 1U);
  ids.sent(1, 10);
  EXPECT_EQ(ids.draw(11, 10, kNone), 11U);
}

TEST(IdsInFlight, FollowEachOtherOverThePlacesOfWhatHasEnded) {
  IdsInFlight ids(kPlaces);
  CommandId next = 1;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(ids.draw(next, 5, kAll), next);
    ids.sent(next, 5);
    next += 5;
  }
}

TEST(IdsInFlight, StayWhereTheyWereWhenThereAreNone) {
  IdsInFlight ids(kPlaces);
  ids.sent(1, 10);
  ids.sent(11, 10);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(ids.draw(21, 13, kNone), std::nullopt);
  EXPECT_EQ(ids.draw(21, 12, kNone), 21U);
}

TEST(IdsInFlight, NeverMeetThePlaceOfABatchThatRuns) {
  std::mt19937 random(1);
  IdsInFlight ids(kPlaces);
  std::map<CommandId, std::uint64_t> running;  // first id => count
  CommandId next = 1;
  int drawn = 0;
  for (int i = 0; i < 100'000; ++i) {
    const std::uint64_t n = 2 + random() % 6;
    const auto has_ended = [&](CommandId end) { return !running.contains(end - 1); };
    const std::optional<CommandId> first = ids.draw(next, n, has_ended);
    if (first) {
      ASSERT_GE(*first, next);
      std::set<std::uint64_t> taken;
      for (const auto& [begin, count] : running) {
        for (CommandId id = begin; id < begin + count; ++id) taken.insert(id % kPlaces);
      }
      for (CommandId id = *first; id < *first + n; ++id) {
        ASSERT_FALSE(taken.contains(id % kPlaces)) << "id " << id;
      }
      ids.sent(*first, n);
      running.emplace(*first, n);
      next = *first + n;
      ++drawn;
    } else {
      ASSERT_GE(running.size(), 2U) << "there was room";
    }
    while (running.size() > 3 || (!running.empty() && random() % 3 == 0)) {
      running.erase(std::next(running.begin(), static_cast<long>(random() % running.size())));
    }
  }
  EXPECT_GT(drawn, 50'000);
}

}  // namespace
}  // namespace o80
