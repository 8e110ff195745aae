#include "o80/memory/spinner.hpp"

#include <gtest/gtest.h>
#include <sched.h>

#include <thread>

namespace o80 {
namespace {

bool fails_once(Spinner& spinner) {
  const bool spun = spinner.worth();
  if (spun) spinner.ended(false);
  return spun;
}

TEST(Spinner, NeverSpinsOnASingleProcessor) {
  Spinner spinner(1);
  for (std::uint32_t i = 0; i < 3 * Spinner::kProbe; ++i) EXPECT_FALSE(spinner.worth());
}

TEST(Spinner, SpinsInAPinnedThreadOfAProcessThatMayUseMoreProcessors) {
  if (std::thread::hardware_concurrency() < 2) GTEST_SKIP() << "there is one processor only";
  std::thread([] {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(sched_getcpu(), &one);
    ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
    Spinner spinner;
    EXPECT_TRUE(spinner.worth());
  }).join();
}

TEST(Spinner, StopsAfterEightFailuresAndProbesNowAndThen) {
  Spinner spinner(2);
  for (std::uint32_t i = 0; i < Spinner::kPatience; ++i) EXPECT_TRUE(fails_once(spinner));

  int spins = 0;
  for (std::uint32_t i = 0; i < 10 * Spinner::kProbe; ++i) spins += fails_once(spinner) ? 1 : 0;
  EXPECT_EQ(spins, 10);
}

TEST(Spinner, IsRestoredByOneSuccess) {
  Spinner spinner(2);
  while (fails_once(spinner)) {
  }
  while (!spinner.worth()) {
  }
  spinner.ended(true);

  for (std::uint32_t i = 0; i < Spinner::kPatience; ++i) EXPECT_TRUE(fails_once(spinner));
  EXPECT_FALSE(fails_once(spinner));
}

TEST(Spinner, LooksOnceEvenWhenItDoesNotSpin) {
  Spinner spinner(1);
  EXPECT_TRUE(spinner.spin([] { return true; }));
  EXPECT_FALSE(spinner.spin([] { return false; }));
}

TEST(Spinner, EndsAfterABoundedMoment) {
  Spinner spinner(2);
  const std::int64_t begin = monotonic_now();
  EXPECT_FALSE(spinner.spin([] { return false; }));
  EXPECT_GE(monotonic_now() - begin, Spinner::kLongest);
}

}  // namespace
}  // namespace o80
