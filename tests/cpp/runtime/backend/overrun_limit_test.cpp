#include "runtime/backend/overrun_limit.hpp"

#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

constexpr std::int64_t kMilli = 1'000'000;  // [ns]

TEST(OverrunLimit, CountsWithinASecondExactly) {
  OverrunLimit limit(3);
  EXPECT_FALSE(limit.exceeded(0));
  EXPECT_FALSE(limit.exceeded(10 * kMilli));
  EXPECT_FALSE(limit.exceeded(1000 * kMilli)) << "the first one is a second old";
  EXPECT_TRUE(limit.exceeded(1009 * kMilli));
  EXPECT_FALSE(limit.exceeded(2000 * kMilli));
}

TEST(OverrunLimit, OfOneIsTheFirst) { EXPECT_TRUE(OverrunLimit(1).exceeded(5)); }

TEST(OverrunLimit, OfNoneIsNeverExceeded) {
  OverrunLimit limit(0);
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE(limit.exceeded(i));
}

using OverrunLimitTest = ManualBackendTest;

TEST_F(OverrunLimitTest, HaltsTheBackend) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .max_overruns = 2});
  manual.backend.set_timing({.lateness = 5, .overruns = 1});
  manual.backend.set_timing({.lateness = 0, .overruns = 1});
  manual.run(1);
  EXPECT_FALSE(frontend.halted());
  manual.backend.set_timing({.lateness = 5, .overruns = 2});
  manual.run(1);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->cause, HaltCause::overruns);
}

// rule W8
TEST(GapLimit, IsExceededByOneLongGapOnly) {
  constexpr std::int64_t kMs = 1'000'000;
  GapLimit limit(100 * kMs);
  std::int64_t now = 5'000 * kMs;
  EXPECT_EQ(limit.exceeded(0, now), 0);
  EXPECT_EQ(limit.exceeded(1, now += 3'000 * kMs), 0) << "a driver loads something before row 1";
  for (Iteration row = 2; row < 10'000; ++row) {
    EXPECT_EQ(limit.exceeded(row, now += (row % 50 == 0 ? 100 : 20) * kMs), 0) << "late, no gap";
  }
  EXPECT_EQ(limit.exceeded(10'000, now += 3'600'000 * kMs), 3'600'000 * kMs) << "the machine slept";
  EXPECT_EQ(limit.exceeded(10'001, now += kMs), 0);
}

}  // namespace
}  // namespace o80::test
