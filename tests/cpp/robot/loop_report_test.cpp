#include "robot/loop_report.hpp"

#include <gmock/gmock.h>

#include "memory/private_directory.hpp"
#include "o80/base/time.hpp"

namespace o80::test {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kSecond = 1'000'000'000;

RowHead row(std::int64_t iteration, std::uint32_t overruns, std::uint32_t skipped = 0) {
  RowHead head;
  head.iteration = iteration;
  head.overruns = overruns;
  head.skipped = skipped;
  return head;
}

TEST(OverrunReport, SaysNothingWhileAllIterationsAreInTime) {
  OverrunReport report;
  EXPECT_FALSE(report.look(row(1000, 0), kSecond));
  EXPECT_FALSE(report.look(row(2000, 0), 2 * kSecond));
}

TEST(OverrunReport, SaysHowManyAtOnceAndThenAtALimitedRate) {
  OverrunReport report;
  EXPECT_THAT(
      report.look(row(1000, 303, 12), kSecond).value_or(""),
      HasSubstr("303 of the last 1000 iterations were late or missed their tick, 12 periods"));
  for (int second = 2; second < 11; ++second) {
    EXPECT_FALSE(report.look(row(second * 1000, 303 * static_cast<std::uint32_t>(second)),
                             second * kSecond));
  }
  EXPECT_THAT(
      report.look(row(11000, 3333, 12), 11 * kSecond).value_or(""),
      HasSubstr("3030 of the last 10000 iterations were late or missed their tick, 0 periods"));
  EXPECT_FALSE(report.look(row(30000, 3333, 12), 30 * kSecond)) << "none since";
}

TEST(LoopReport, EndsAtOnceAlthoughItHasFoundNoBackend) {
  const PrivateDirectory directory;
  const std::int64_t begin = monotonic_now();
  {
    const LoopReport report("gone");
  }
  EXPECT_LT(monotonic_now() - begin, 5 * kSecond / 2) << "it waits 5 s for a backend that may come";
}

}  // namespace
}  // namespace o80::test
