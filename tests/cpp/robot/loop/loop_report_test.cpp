#include "robot/loop/loop_report.hpp"

#include <gmock/gmock.h>

#include "memory/private_directory.hpp"
#include "o80/base/time.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::Eq;
using ::testing::HasSubstr;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kPeriod = kSecond / 1000;

RowHead row(std::int64_t iteration, std::uint32_t overruns, std::uint32_t skipped = 0) {
  RowHead head;
  head.iteration = iteration;
  head.overruns = overruns;
  head.skipped = skipped;
  head.time = iteration * kSecond / 100;  // 100 Hz are reached
  return head;
}

TEST(OverrunReport, SaysHowManyAtOnceAndThenAtALimitedRate) {
  OverrunReport report(kPeriod);
  EXPECT_FALSE(report.poll(row(0, 0), kSecond / 2));
  EXPECT_THAT(report.poll(row(1000, 303, 12), kSecond).value_or(""),
              AllOf(HasSubstr("303 of the last 1000 iterations were late or missed their tick"),
                    HasSubstr("100 Hz reached of 1000, 12 periods were skipped")));
  for (int second = 2; second < 11; ++second) {
    EXPECT_FALSE(report.poll(row(second * 1000, 303 * static_cast<std::uint32_t>(second)),
                             second * kSecond));
  }
  EXPECT_THAT(report.poll(row(11000, 3333, 12), 11 * kSecond).value_or(""),
              AllOf(HasSubstr("3030 of the last 10000 iterations were late"),
                    HasSubstr("0 periods were skipped")));
  EXPECT_FALSE(report.poll(row(30000, 3333, 12), 30 * kSecond)) << "none since";
}

TEST(OverrunReport, CountsOnlyRowsSinceTheLastOnesInTime) {
  OverrunReport report(kPeriod);
  EXPECT_FALSE(report.poll(row(0, 0), kSecond));
  EXPECT_FALSE(report.poll(row(5000, 0), 50 * kSecond));
  EXPECT_THAT(report.poll(row(5100, 3), 51 * kSecond).value_or(""),
              HasSubstr("3 of the last 100 iterations"));
}

TEST(HangReport, SaysWhatHangsAtALimitedRateAndWhenItIsOver) {
  LoopState loop;
  loop.life = Life::running;
  loop.period = kPeriod;
  loop.row_age = 0;
  HangReport report;
  EXPECT_FALSE(report.poll(loop, kSecond));

  loop.row_age = 10 * kSecond;
  loop.slow_verb = Verb::read;
  loop.slow_for = 9 * kSecond;
  EXPECT_THAT(report.poll(loop, 2 * kSecond).value_or(""),
              Eq("no row for 10 s: read() of the driver has been running for 9 s"));
  EXPECT_FALSE(report.poll(loop, 11 * kSecond));
  EXPECT_TRUE(report.poll(loop, 12 * kSecond));

  loop.row_age = 0;
  loop.slow_verb = Verb::none;
  EXPECT_EQ(report.poll(loop, 13 * kSecond).value_or(""), "the loop continues");
  EXPECT_FALSE(report.poll(loop, 14 * kSecond));
}

TEST(LoopReport, EndsAtOnceAlthoughItHasFoundNoBackend) {
  const PrivateDirectory directory;
  const std::int64_t begin = monotonic_now();
  {
    const LoopReport report("gone");
  }
  EXPECT_LT(monotonic_now() - begin, 5 * kSecond) << "it waits 5 s for a backend that may come";
}

}  // namespace
}  // namespace o80::test
