#include "robot/loop/loop.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <string_view>
#include <tuple>

#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

using ::testing::Pair;

class LoopTest : public FakeDriverTest {
 protected:
  static constexpr std::int64_t kPeriod = 200'000;  // [ns]

  static BackendOptions in(bool bursting) {
    return {.segment = "fake", .period = kPeriod, .bursting = bursting};
  }
  /// When waiting readers expect the next row [ns]; 0: unknown.
  static std::int64_t next_row_at() {
    return AttachedSegment::attach("fake", Access::read_only, Deadline(kPatience))
        .view()
        .counters()
        .next_at;
  }
};

TEST_F(LoopTest, StartsThenReadsThenIsRunning) {
  Loop loop(driver(), in(true));
  EXPECT_EQ(FakeDriver::calls.started, 0) << "the name is taken before the hardware is touched";
  EXPECT_THROW(UntypedFrontend("fake", {.timeout = kAtOnce}), TimeoutError);
  loop.start();
  EXPECT_EQ(FakeDriver::calls.started, 1);
  EXPECT_EQ(FakeDriver::calls.read, 1);
  EXPECT_EQ(FakeDriver::calls.written, 0);
  EXPECT_EQ(UntypedFrontend("fake").latest().iteration(), 0);
}

TEST_F(LoopTest, WritesAndReadsOnceAnIteration) {
  const auto loop = started({}, in(true));
  UntypedFrontend frontend("fake");
  add(frontend, 1, 4.0, {.pace = iterations(4)});
  frontend.start_burst(5);
  std::vector<Iteration> written;
  FakeDriver::on_write = [&](const Desired<FakeDriver>& desired) {
    written.push_back(desired.iteration());
    EXPECT_EQ(desired.active(1), desired.iteration() <= 4);
    EXPECT_FALSE(desired.active(0));
    EXPECT_EQ(desired.time(), desired.iteration() * kPeriod);
    EXPECT_DOUBLE_EQ(desired.period(), 2e-4);
  };
  EXPECT_EQ(loop->run_granted(kAll), Step::standing);
  EXPECT_THAT(written, ::testing::ElementsAre(1, 2, 3, 4, 5));
  EXPECT_EQ(FakeDriver::calls.read, 6);
  EXPECT_EQ(observed(frontend.latest(), 1), 4.0);
  EXPECT_EQ(next_row_at(), 0) << "bursting has no due times";
}

/// A driver that forks in one of its functions, and whose child returns from it.
class ForkingLoop : public LoopTest,
                    public ::testing::WithParamInterface<std::tuple<const char*, bool>> {
 protected:
  void fork_at(Iteration now) {
    if (child_ == 0) _exit(kGoesOn);
    if (now != 2) return;
    child_ = fork();
    if (child_ == 0) dup2(said_[1], STDERR_FILENO);
  }
  /// How the child ended, and what it said.
  std::pair<int, std::string> end_of_child() {
    close(said_[1]);
    std::string text;
    char part = 0;
    while (read(said_[0], &part, 1) == 1) text += part;
    close(said_[0]);
    int status = -1;
    EXPECT_EQ(waitpid(child_, &status, 0), child_);
    return {WEXITSTATUS(status), text};
  }

  static constexpr int kGoesOn = 7;
  pid_t child_ = -1;
  std::array<int, 2> said_{};
};

TEST_P(ForkingLoop, EndsTheChildWhichTouchesNothing) {
  const auto [verb, bursting] = GetParam();
  ASSERT_EQ(pipe(said_.data()), 0);
  const bool writes = std::string_view(verb) == "write";
  FakeDriver::on_write = [&](const Desired<FakeDriver>& desired) {
    if (writes || child_ == 0) fork_at(desired.iteration());
  };
  FakeDriver::on_read = [&](Reading<FakeDriver>& reading) {
    if (!writes || child_ == 0) fork_at(reading.iteration());
  };
  const auto loop = started({{"finish_at", "4"}}, in(bursting));
  UntypedFrontend frontend("fake");
  if (bursting) frontend.start_burst(4);
  EXPECT_TRUE(loop->run().in_order);

  EXPECT_THAT(end_of_child(), Pair(1, HasSubstr(std::string("'fake' forked in ") + verb)));
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
  EXPECT_EQ(frontend.published(), 4);
  EXPECT_EQ(frontend.life(), Life::stopped);
}

INSTANTIATE_TEST_SUITE_P(, ForkingLoop,
                         ::testing::Combine(::testing::Values("write", "read"), ::testing::Bool()));

/// What frontends see of a loop that fails, wherever.
class LoopFails : public LoopTest,
                  public ::testing::WithParamInterface<std::pair<const char*, const char*>> {};

TEST_P(LoopFails, OnTheWayAndSaysSoInTheSegmentAndStopsItsDriverOnce) {
  const auto [fails, why] = GetParam();
  auto loop = std::make_unique<Loop>(driver({{"fails", fails}}), in(true));
  std::thread waiter([why] {
    // whoever waits to attach raises it
    const std::string text =
        message_of<BackendFailed>([] { UntypedFrontend("fake", {.timeout = kPatience}); });
    EXPECT_THAT(text, AllOf(HasSubstr("'fake'"), HasSubstr(why)));
  });
  EXPECT_THAT(message_of<DriverError>([&] { loop->start(); }), HasSubstr(why));
  waiter.join();
  loop.reset();
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
  EXPECT_EQ(FakeDriver::calls.destroyed, 1);
  EXPECT_THROW(UntypedFrontend("fake", {.timeout = kPatience}), BackendFailed);
}

INSTANTIATE_TEST_SUITE_P(WhileItStarts, LoopFails,
                         ::testing::Values(std::pair("start", "failed in start: no power"),
                                           std::pair("first_read", "failed in read: blind")));

class LoopBreaks : public LoopFails {};

TEST_P(LoopBreaks, InAnIterationAndSaysSoInTheSegmentAndStopsItsDriverOnce) {
  const auto [fails, why] = GetParam();
  auto loop = started({{"fails", fails}});
  UntypedFrontend frontend("fake");
  std::thread runner([&] {
    const Ended ended = loop->run();
    EXPECT_FALSE(ended.in_order);
    EXPECT_THAT(ended.fault, HasSubstr(why));
  });
  add(frontend, 0, 1.0, {.pace = iterations(100)});
  EXPECT_THAT(message_of<BackendFailed>([&] { frontend.burst(10, kPatience); }), HasSubstr(why));
  runner.join();
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
  EXPECT_EQ(frontend.published(), 2) << "the iteration that failed has no row";
  EXPECT_THAT(message_of<BackendFailed>([&] { frontend.wait_for(3, kPatience); }), HasSubstr(why));
  loop.reset();
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

INSTANTIATE_TEST_SUITE_P(WhileItRuns, LoopBreaks,
                         ::testing::Values(std::pair("write", "failed in write: wire cut"),
                                           std::pair("read", "failed in read: went blind"),
                                           std::pair("fault", "failed in read: too hot"),
                                           std::pair("odd", "not a std::exception")));

TEST_F(LoopTest, EndsWhenARequestFailsOrThrows) {
  for (const auto& [how, why] : {std::pair(3U, "poked too hard"), std::pair(4U, "ouch")}) {
    FakeDriver::calls = {};
    const auto loop = started();
    UntypedFrontend frontend("fake");
    const Batch batch = poke(frontend, how);
    EXPECT_EQ(loop->run_granted(kAll), Step::ended);
    EXPECT_THAT(loop->fault(), AllOf(HasSubstr("failed in poke"), HasSubstr(why)));
    EXPECT_EQ(batch.handle(0).text, why);
    EXPECT_THAT(message_of<BackendFailed>([&] { frontend.wait_for(1, kPatience); }),
                HasSubstr(why));
    EXPECT_EQ(FakeDriver::calls.stopped, 1);
  }
}

TEST_F(LoopTest, KeepsItsPeriodAndStopsWhenAsked) {
  const auto loop = started({}, in(false));
  UntypedFrontend frontend("fake");
  std::thread runner([&] { EXPECT_TRUE(loop->run().in_order); });
  const std::int64_t begin = frontend.wait_for(1, kPatience).time();
  const UntypedObservation row = frontend.wait_for(51, kPatience);
  EXPECT_GE(row.time() - begin, 49 * kPeriod) << "never faster than its period";
  EXPECT_GT(next_row_at(), row.time());
  loop->ask_to_stop();
  runner.join();
  EXPECT_EQ(frontend.life(), Life::stopped);
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

// rule W9
TEST_F(LoopTest, PublishesAnOverrunAndSkipsThePeriodsInsteadOfHurrying) {
  const auto loop = started({}, in(false));
  UntypedFrontend frontend("fake");
  FakeDriver::on_write = [](const Desired<FakeDriver>& desired) {
    if (desired.iteration() != 5) return;
    const std::int64_t until = monotonic_now() + 2'100'000;  // ten periods and a half
    while (monotonic_now() < until) {
    }
  };
  std::thread runner([&] { loop->run(); });
  const RowHead before = frontend.wait_for(4, kPatience).head();
  const RowHead late = frontend.wait_for(5, kPatience).head();
  const RowHead after = frontend.wait_for(40, kPatience).head();
  loop->ask_to_stop();
  runner.join();
  EXPECT_GE(late.overruns, before.overruns + 1);
  EXPECT_GE(late.skipped, before.skipped + 9);
  EXPECT_GE(late.lateness, 1'800'000);
  EXPECT_GE(after.time - late.time, 34 * kPeriod) << "what follows keeps its period";
}

}  // namespace
}  // namespace o80::test
