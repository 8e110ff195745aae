#include "runtime/frontend/loop_state.hpp"

#include <unistd.h>

#include <thread>

#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using ::testing::Eq;
using ::testing::Optional;
using LoopStateTest = ManualBackendTest;

constexpr std::int64_t kSecond = 1'000'000'000;

/// 303 of 304 iterations overran.
LoopState late_loop() {
  LoopState state;
  state.life = Life::running;
  state.pid = 4711;
  state.period = kSecond / 1000;
  state.row_age = 0;
  state.rate = 99.2;
  state.recent_rows = 304;
  state.recent_overruns = 303;
  return state;
}

std::int64_t time_of(const UntypedFrontend& frontend, Iteration k) {
  return frontend.wait_for(k, kPatience).head().time;
}

TEST_F(LoopStateTest, GivesTheRateAtWhichRowsCame) {
  StartedBackend manual;
  const UntypedFrontend frontend("pair", {.access = Access::read_only});
  Timing timing;
  for (timing.overruns = 1; timing.overruns <= 20; ++timing.overruns) {
    manual.backend.set_timing(timing);
    ASSERT_EQ(manual.iterate(), Step::run);
  }

  const std::int64_t first = time_of(frontend, 0);
  const std::int64_t last = time_of(frontend, 20);
  if (last - first > kSecond) GTEST_SKIP() << "twenty iterations took more than a second";
  const LoopState state = loop_state(frontend, last + kSecond / 10);

  EXPECT_THAT(state.rate, Optional(20.0 * 1e9 / static_cast<double>(last - first)));
  EXPECT_EQ(state.recent_rows, 20U);
  EXPECT_EQ(state.recent_overruns, 20U);
  EXPECT_EQ(state.overruns, 20U);
  EXPECT_THAT(state.row_age, Optional(kSecond / 10));
  EXPECT_THAT(state.trouble(), HasSubstr("20 of the last 20 iterations were late"));
}

TEST_F(LoopStateTest, OfRowsThatStoppedComingHasARateOfZero) {
  ManualBackend manual;
  manual.start().iterate();
  const UntypedFrontend frontend("pair", {.access = Access::read_only});
  const LoopState state = loop_state(frontend, time_of(frontend, 1) + 10 * kSecond);

  EXPECT_TRUE(state.stalled());
  EXPECT_THAT(state.rate, Optional(0.0));
  EXPECT_THAT(state.trouble(), HasSubstr("no row for 10 s"));
}

TEST_F(LoopStateTest, OfABackendThatWaitsForABurstKnowsNeitherRateNorAge) {
  StartedBackend manual({.segment = "pair", .bursting = true});
  const UntypedFrontend frontend("pair", {.access = Access::read_only});
  const LoopState state = loop_state(frontend, monotonic_now() + 10 * kSecond);

  EXPECT_FALSE(state.rate.has_value());
  EXPECT_FALSE(state.row_age.has_value());
  EXPECT_EQ(state.trouble(), "") << "it stands still, which is no hang";
}

TEST_F(LoopStateTest, TellsAVerbThatHangsFromABackendThatStandsStill) {
  StartedBackend manual({.segment = "pair", .bursting = true});
  const UntypedFrontend frontend("pair", {.access = Access::read_only});
  manual.backend.enter(Verb::read);
  while (loop_state(frontend).slow_verb == Verb::none) std::this_thread::yield();

  const LoopState state = loop_state(frontend, monotonic_now() + 10 * kSecond);
  EXPECT_EQ(state.slow_verb, Verb::read);
  EXPECT_THAT(state.trouble(), HasSubstr("read() of the driver has been running for 1"));

  manual.backend.leave();
  EXPECT_EQ(loop_state(frontend).trouble(), "");
}

TEST_F(LoopStateTest, IsKnownBeforeTheFirstRow) {
  ManualBackend manual;
  manual.backend.enter(Verb::start);
  const UntypedFrontend frontend("pair", {.access = Access::read_only, .starting = true});
  while (loop_state(frontend).slow_verb == Verb::none) std::this_thread::yield();

  const LoopState state = loop_state(frontend, monotonic_now() + 10 * kSecond);
  EXPECT_EQ(state.life, Life::starting);
  EXPECT_EQ(state.last, -1);
  EXPECT_THAT(state.trouble(), HasSubstr("start() of the driver has been running for 1"));
}

TEST(LoopState, SaysTheRealRateOfALoopThatOverran) {
  EXPECT_EQ(late_loop().trouble(),
            "303 of the last 304 iterations were late or missed their tick: 99.2 Hz reached of "
            "1000");
}

TEST(LoopState, SaysOfMissingRowsWhatTheDriverDoes) {
  LoopState state = late_loop();
  state.row_age = 10 * kSecond;
  EXPECT_THAT(state.trouble(), HasSubstr("no row for 10 s: its process (pid 4711) gets no"));
  state.slow_verb = Verb::wait;
  state.slow_for = 9 * kSecond;
  EXPECT_EQ(state.trouble(), "no row for 10 s: wait() of the driver has been running for 9 s");
  state.process_stopped = true;
  EXPECT_EQ(state.trouble(),
            "no row for 10 s: its process (pid 4711) is stopped, continue it with `kill -CONT "
            "4711`");
}

TEST(LoopState, NamesTheVerbFromTheMomentThatRowsAreMissed) {
  LoopState state = late_loop();
  state.row_age = kSecond + 3 * state.period;
  state.slow_verb = Verb::write;
  state.slow_for = kSecond - 20'000'000;  // the helper thread noted it 23 ms after the row

  EXPECT_THAT(state.hang(), HasSubstr("write() of the driver has been running for"));
}

TEST(LoopState, AllowsALoopItsOwnPeriod) {
  LoopState state = late_loop();
  state.recent_overruns = 0;
  state.period = 10 * kSecond;
  state.row_age = 15 * kSecond;
  state.slow_verb = Verb::wait;
  state.slow_for = 9 * kSecond;
  EXPECT_EQ(state.trouble(), "");
}

}  // namespace
}  // namespace o80::test
