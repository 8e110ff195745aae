// A driver that paces the loop itself, and one whose wait returns too early.

#include <gmock/gmock.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <thread>

#include "o80/robot/make_table.hpp"
#include "robot/loop/loop.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// Ticks by itself, until its cable is pulled.
class Ticking {
 public:
  struct Config {};
  using Actuators = std::array<double, 1>;

  static inline int in_time = 0;  // waits that take their time
  static inline int stopped = 0;
  static inline std::function<void(Reading<Ticking>&)> on_read;
  static inline std::function<void()> on_wait;

  explicit Ticking(const Config&) {}
  void start() {}
  void write(const Desired<Ticking>& desired) { now_ = desired.states; }
  void read(Reading<Ticking>& reading) {
    reading.observed = now_;
    if (on_read) on_read(reading);
    if (reading.iteration() == 100'000) reading.finish();  // nobody has noticed
  }
  void wait(std::int64_t due) {
    if (on_wait) on_wait();
    if (++waits_ > in_time) return;
    while (!sleep_until(due)) {
    }
  }
  void stop() noexcept { ++stopped; }

 private:
  std::array<double, 1> now_{};
  int waits_ = 0;
};
O80_DESCRIBE(Ticking::Config);

class TickTest : public StationTest {
 protected:
  TickTest() {
    Ticking::in_time = 1'000'000;
    Ticking::stopped = 0;
    Ticking::on_read = {};
    Ticking::on_wait = {};
  }
  static std::unique_ptr<Loop> make(const BackendOptions& options) {
    return std::make_unique<Loop>(
        std::make_unique<DriverInstance>(*robot_table<Ticking>("ticking"), OptionValues{}),
        options);
  }
};

TEST_F(TickTest, AWaitThatReturnsAtOnceIsAFaultBeforeItMovesTheRobotFar) {
  Ticking::in_time = 20;
  const auto loop = make({.segment = "ticking", .period = 1'000'000});
  loop->start();
  const Ended ended = loop->run();
  EXPECT_FALSE(ended.in_order);
  EXPECT_THAT(ended.fault, AllOf(HasSubstr("failed in wait"), HasSubstr("ticks came in"),
                                 HasSubstr("--frequency"), HasSubstr("wait")));
  EXPECT_EQ(Ticking::stopped, 1);
  EXPECT_GE(loop->backend().iteration(), 20 + 10);
}

TEST_F(TickTest, ATickWithoutAReadingCountsInItsRowLikeAnOverrun) {
  const auto loop = make({.segment = "ticking", .period = 1'000'000});
  Ticking::on_read = [](Reading<Ticking>& reading) {
    const std::int64_t i = reading.iteration();
    if (i == 5 || i == 6 || i == 9) reading.missed();
    if (i == 12) reading.finish();
  };
  loop->start();
  const UntypedFrontend frontend("ticking");
  EXPECT_TRUE(loop->run().in_order);
  const auto overruns = [&](std::int64_t i) {
    return frontend.wait_for(i, kPatience).head().overruns;
  };
  for (const std::int64_t i : {5, 6, 9}) EXPECT_EQ(overruns(i) - overruns(i - 1), 1U) << i;
}

TEST_F(TickTest, TooManyTicksWithoutAReadingHalt) {
  const auto loop = make({.segment = "ticking", .period = 1'000'000, .max_overruns = 3});
  Ticking::on_read = [](Reading<Ticking>& reading) {
    reading.missed();
    if (reading.iteration() == 12) reading.finish();
  };
  loop->start();
  const UntypedFrontend frontend("ticking");
  EXPECT_TRUE(loop->run().in_order);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->cause, HaltCause::overruns);
  EXPECT_LE(frontend.halted()->iteration, 4);
}

TEST_F(TickTest, TheStepAfterMissedTicksIsNotLarger) {
  const auto loop = make({.segment = "ticking", .period = 1'000'000});
  Ticking::on_wait = [waits = 0]() mutable {
    if (++waits != 10) return;
    const std::int64_t until = monotonic_now() + 5'600'000;
    while (!sleep_until(until)) {
    }
  };
  Ticking::on_read = [](Reading<Ticking>& reading) {
    if (reading.iteration() == 21) reading.finish();
  };
  loop->start();
  UntypedFrontend frontend("ticking");
  add(frontend, 0, 20.0, {.pace = iterations(20)});
  frontend.pulse();
  EXPECT_TRUE(loop->run().in_order);
  const RowHead before = frontend.wait_for(9, kPatience).head();
  const RowHead late = frontend.wait_for(10, kPatience).head();
  EXPECT_GE(late.skipped - before.skipped, 5U);
  EXPECT_EQ(late.overruns - before.overruns, 1U);
  for (std::int64_t i = 2; i <= 20; ++i) {
    EXPECT_DOUBLE_EQ(desired(frontend.wait_for(i, kPatience), 0) -
                         desired(frontend.wait_for(i - 1, kPatience), 0),
                     1.0)
        << i;
  }
}

}  // namespace
}  // namespace o80::test
