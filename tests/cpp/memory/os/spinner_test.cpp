#include "memory/os/spinner.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <functional>
#include <thread>

namespace {
/// What happens while a spinning thread of a test lets others run. A plain pointer: sanitizers
/// yield while they hold the allocator's locks, and the first use of anything else would allocate.
thread_local constinit const std::function<void()>* others = nullptr;
}  // namespace

/// In the place of the C library's.
extern "C" int sched_yield() {
  if (others == nullptr) return static_cast<int>(syscall(SYS_sched_yield));
  (*others)();
  return 0;
}

namespace o80 {
namespace {

void run_for(std::int64_t duration) {
  const std::int64_t end = monotonic_now() + duration;
  while (monotonic_now() < end) {
  }
}

bool fails_once(Spinner& spinner) {
  const bool spun = spinner.should_spin();
  if (spun) spinner.ended(false);
  return spun;
}

TEST(Spinner, NeverSpinsOnASingleProcessor) {
  Spinner spinner(1);
  for (std::uint32_t i = 0; i < 3 * Spinner::kProbe; ++i) EXPECT_FALSE(spinner.should_spin());
}

TEST(Spinner, SpinsInAPinnedThreadOfAProcessThatMayUseMoreProcessors) {
  cpu_set_t all;
  ASSERT_EQ(sched_getaffinity(getpid(), sizeof all, &all), 0);
  if (CPU_COUNT(&all) < 2) GTEST_SKIP() << "this process may use one processor only";
  std::thread([] {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(sched_getcpu(), &one);
    ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
    Spinner spinner;
    EXPECT_TRUE(spinner.should_spin());
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
  while (!spinner.should_spin()) {
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

TEST(Spinner, SpinsAsLongAsItIsAllowedTo) {
  constexpr std::int64_t kLonger = 10 * Spinner::kLongest;
  Spinner spinner(2, kLonger);
  const std::int64_t begin = monotonic_now();
  EXPECT_FALSE(spinner.spin([] { return false; }));
  EXPECT_GE(monotonic_now() - begin, kLonger);
}

class SpinnerAmongOthers : public testing::Test {
 protected:
  ~SpinnerAmongOthers() override { others = nullptr; }

  /// Spins once, in vain; how often it let others run, and when first: after how long [ns], and
  /// after how many looks (all of them if it did not).
  struct Spun {
    int yields = 0;
    std::int64_t first = 0;
    int looks = 0;
  };
  static Spun spin_in_vain(Spinner& spinner, std::int64_t others_take,
                           std::int64_t look_takes = 0) {
    Spun spun;
    const std::int64_t begin = monotonic_now();
    int looks = 0;
    const std::function<void()> run = [&] {
      if (spun.yields++ == 0) {
        spun.first = monotonic_now() - begin;
        spun.looks = looks;
      }
      run_for(others_take);
    };
    others = &run;
    EXPECT_FALSE(spinner.spin([&] {
      ++looks;
      run_for(look_takes);
      return false;
    }));
    others = nullptr;
    if (spun.yields == 0) spun.looks = looks;
    spinner.ended(true);  // so that it goes on spinning
    return spun;
  }

  /// Spins in vain until only probes spin, and waits until the next one is due.
  void await_probe() {
    for (std::uint32_t i = 0; i < Spinner::kPatience; ++i) spinner_.ended(false);
    for (std::uint32_t i = 1; i < Spinner::kProbe; ++i) EXPECT_FALSE(spinner_.should_spin());
  }

  Spinner spinner_{2};
};

TEST_F(SpinnerAmongOthers, LetsTheOneItWaitsForRun) {
  bool done = false;
  const std::function<void()> run = [&] { done = true; };
  others = &run;
  EXPECT_TRUE(spinner_.spin([&] { return done; }));
}

TEST_F(SpinnerAmongOthers, SpinsAloneAtFirst) {
  EXPECT_GE(spin_in_vain(spinner_, 0).first, Spinner::kAlone);
}

TEST_F(SpinnerAmongOthers, LetsThemRunAtOnceWhileSomebodyDoes) {
  spin_in_vain(spinner_, 2 * Spinner::kSwitched);
  // as soon as it looks at the clock
  EXPECT_EQ(spin_in_vain(spinner_, 2 * Spinner::kSwitched).looks, 17);
}

TEST_F(SpinnerAmongOthers, ProbesWithoutLettingThemRunHoweverLongItWasKeptFromRunning) {
  for (const std::int64_t look_takes : {std::int64_t{0}, 3 * Spinner::kLongest}) {
    await_probe();
    const std::int64_t begin = monotonic_now();
    const Spun spun = spin_in_vain(spinner_, 0, look_takes);
    EXPECT_EQ(spun.yields, 0);
    EXPECT_GT(spun.looks, 1) << "it did probe";
    EXPECT_GE(monotonic_now() - begin, Spinner::kLongest);
  }
}

TEST_F(SpinnerAmongOthers, DoesNotForLongWhereOthersKeepTheProcessor) {
  EXPECT_EQ(spin_in_vain(spinner_, Spinner::kTooLong + 1).yields, 1);
  // each spin of the test ends twice
  for (std::uint32_t i = 4; i < Spinner::kYieldHoldoff; ++i) spinner_.ended(true);
  EXPECT_EQ(spin_in_vain(spinner_, 0).yields, 0);
  EXPECT_GT(spin_in_vain(spinner_, 0).yields, 0);
}

}  // namespace
}  // namespace o80
