// A driver that paces the loop itself, and one whose wait returns too early.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>

#include "o80/robot/make_table.hpp"
#include "robot/loop/loop.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

/// Ticks by itself, until its cable is pulled.
class Ticking {
 public:
  struct Config {};
  using Actuators = std::array<double, 1>;

  static inline int in_time = 0;  // waits that take their time
  static inline std::int64_t finish_at = 0;
  static inline std::function<void(Reading<Ticking>&)> on_read;
  static inline std::function<void()> on_wait;

  explicit Ticking(const Config&) {}
  void describe(Schema& schema) const { schema.simulated(); }
  void start() {}
  void write(const Desired<Ticking>& desired) { now_ = desired.states; }
  void read(Reading<Ticking>& reading) {
    reading.observed = now_;
    if (on_read) on_read(reading);
    if (reading.iteration() == finish_at) reading.finish();
  }
  void wait(std::int64_t due) {
    if (on_wait) on_wait();
    if (++waits_ <= in_time) sleep(due);
  }
  static void sleep(std::int64_t until) {
    while (!sleep_until(until)) {
    }
  }
  void stop() noexcept {}

 private:
  std::array<double, 1> now_{};
  int waits_ = 0;
};
O80_DESCRIBE(Ticking::Config);

class TickTest : public ManualBackendTest {
 protected:
  TickTest() {
    Ticking::in_time = 1'000'000;
    Ticking::on_read = {};
    Ticking::on_wait = {};
  }
  static std::unique_ptr<Loop> started_until(std::int64_t finish_at) {
    Ticking::finish_at = finish_at;
    auto loop = std::make_unique<Loop>(
        std::make_unique<DriverInstance>(*robot_table<Ticking>("ticking"), OptionValues{}),
        BackendOptions{.segment = "ticking", .period = 1'000'000});
    loop->start();
    return loop;
  }
};

TEST_F(TickTest, AWaitThatReturnsAtOnceHaltsAndTheRobotDoesNotBrakeFasterThanItMay) {
  Ticking::in_time = 20;
  const auto loop = started_until(100);
  const UntypedFrontend frontend("ticking");
  EXPECT_TRUE(loop->run().in_order);
  const auto halt = frontend.halted();
  ASSERT_TRUE(halt);
  EXPECT_EQ(halt->cause, HaltCause::overruns);
  EXPECT_EQ(halt->number, 1U) << "one halt, however long it goes on";
  EXPECT_THAT(halt->reason(), AllOf(HasSubstr("ticks of the robot came in"), HasSubstr("jitter"),
                                    HasSubstr("--frequency"), HasSubstr("wait() returns")));
  EXPECT_GE(halt->iteration, 20 + 10);
  const auto time = [&](std::int64_t i) { return frontend.wait_for(i, kPatience).head().time; };
  EXPECT_GE(time(100) - time(20), (80 - 12) * 980'000) << "the loop itself waits";
}

TEST_F(TickTest, JitterOfTheRobotsClockHaltsAndAResumeGoesOn) {
  const auto loop = started_until(330);
  UntypedFrontend frontend("ticking");
  Ticking::on_wait = [waits = 0]() mutable {
    ++waits;
    if (waits > 50 && waits < 250) return;  // many ticks that come together
    Ticking::sleep(monotonic_now() + 1'000'000);
  };
  Ticking::in_time = 0;
  std::uint64_t number = 0;
  Ticking::on_read = [&](Reading<Ticking>& reading) {
    if (reading.iteration() != 300 || reading.fresh()) return;
    if (const auto halt = frontend.halted()) number = halt->number;
    send_resume(frontend, number);
  };
  EXPECT_TRUE(loop->run().in_order);
  EXPECT_EQ(number, 1U);
  EXPECT_FALSE(frontend.halted());
}

TEST_F(TickTest, ATickWithoutAReadingCountsInItsRowLikeAnOverrun) {
  const auto loop = started_until(12);
  Ticking::on_read = [](Reading<Ticking>& reading) {
    const std::int64_t i = reading.iteration();
    if (i == 5 || i == 6 || i == 9) reading.missed();
  };
  const UntypedFrontend frontend("ticking");
  EXPECT_TRUE(loop->run().in_order);
  const auto overruns = [&](std::int64_t i) {
    return frontend.wait_for(i, kPatience).head().overruns;
  };
  for (const std::int64_t i : {5, 6, 9}) EXPECT_EQ(overruns(i) - overruns(i - 1), 1U) << i;
}

// rule W9
TEST_F(TickTest, TheStepAfterMissedTicksIsNotLarger) {
  const auto loop = started_until(21);
  Ticking::on_wait = [waits = 0]() mutable {
    if (++waits == 10) Ticking::sleep(monotonic_now() + 5'600'000);
  };
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
