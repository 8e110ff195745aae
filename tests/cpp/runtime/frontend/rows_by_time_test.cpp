
#include <random>

#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class RowsByTimeTest : public ManualBackendTest {};

/// Simulated time: iteration i is at i milliseconds.
BackendOptions millisecond(std::uint64_t history) {
  return {.segment = "pair", .period = 1'000'000, .bursting = true, .history = history};
}

// rule O7
TEST_F(RowsByTimeTest, AgreesWithASearchThroughAllRowsThatAreThere) {
  auto [manual, frontend] = StartedPair(millisecond(32));
  std::mt19937_64 random(7);
  for (int round = 0; round < 50; ++round) {
    frontend.start_burst(std::uniform_int_distribution<std::int64_t>(1, 9)(random));
    manual.drive();
    const Iteration oldest = frontend.oldest();
    const Iteration newest = frontend.published();
    const auto time = [&] {
      return std::uniform_int_distribution<std::int64_t>((oldest - 3) * 1'000'000,
                                                         (newest + 3) * 1'000'000)(random);
    };
    for (int i = 0; i < 20; ++i) {
      const std::int64_t first = time();
      const std::int64_t last = time();
      Iteration expected = oldest - 1;
      Iteration begin = newest + 1;
      std::size_t count = 0;
      for (Iteration k = newest; k >= oldest; --k) {
        const std::int64_t at = frontend.wait_for(k, kAtOnce).time();
        if (at <= first && expected < k) expected = k;
        if (at < first || at > last) continue;
        begin = k;
        ++count;
      }
      EXPECT_EQ(frontend.iteration_at(first), expected);
      if (expected >= oldest) {
        EXPECT_EQ(frontend.at_time(first).iteration(), expected);
      }
      const Rows rows = frontend.history_between(first, last);
      EXPECT_EQ(rows.count, count);
      if (count > 0) {
        EXPECT_EQ(rows.first, begin);
      }
    }
  }
}

TEST_F(RowsByTimeTest, SaysThatARowIsNoLongerThere) {
  auto [manual, frontend] = StartedPair(millisecond(8));
  frontend.start_burst(100);
  manual.drive();
  EXPECT_THAT(message_of<RowOverwritten>([&] { frontend.at_time(5'000'000); }),
              HasSubstr("the oldest one is row " + std::to_string(frontend.oldest())));
}

}  // namespace
}  // namespace o80::test
