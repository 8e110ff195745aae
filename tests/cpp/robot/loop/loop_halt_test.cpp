// How a loop halts, resumes and stops in order, with a driver that can fail in each of its verbs.

#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <thread>

#include "cases.hpp"
#include "dice.hpp"
#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

class LoopHaltTest : public FakeDriverTest {
 protected:
  static Loop timed_loop(const OptionValues& options = {}) {
    return {driver(options), {.segment = "fake", .period = 100'000}};
  }
};

// rule H10
TEST_F(LoopHaltTest, ADriverMayRefuseToResume) {
  const auto loop = started();
  UntypedFrontend frontend("fake");
  const std::uint64_t number = frontend.halt("");
  loop->run_granted(kAll);
  const auto resume = [&] {
    const Batch batch = send_resume(frontend, number);
    loop->run_granted(kAll);
    return batch.handle(0);
  };
  FakeDriver::on_resume = [] { return Served::rejected("the door is open"); };
  EXPECT_EQ(resume().text, "the door is open");
  EXPECT_TRUE(frontend.halted());
  FakeDriver::on_resume = {};
  EXPECT_EQ(resume().status, Status::completed);
  EXPECT_FALSE(frontend.halted());
  EXPECT_EQ(frontend.latest().head().fresh, 1U);
  EXPECT_EQ(FakeDriver::calls.halted, 1);
  EXPECT_EQ(FakeDriver::calls.resumed, 2);
}

TEST_F(LoopHaltTest, ADriverThatFailsToHaltEndsTheLoop) {
  const auto loop = started({{"fails", "halt"}});
  UntypedFrontend frontend("fake");
  frontend.halt("");
  EXPECT_EQ(loop->run_granted(kAll), Step::ended);
  EXPECT_THAT(loop->fault(), AllOf(HasSubstr("failed in halt"), HasSubstr("no brake")));
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

// ------------------------------------------------------------------------------ readings

// rule R7
TEST_F(LoopHaltTest, AFirstReadingThatIsNoNumberIsAFaultThatNamesIt) {
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    reading.observed[1] = std::numeric_limits<double>::quiet_NaN();
  };
  EXPECT_THAT(message_of<DriverError>([] { started(); }),
              AllOf(HasSubstr("actuator 'right'"), HasSubstr("is NaN or infinite")));
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

// rule R7
TEST_F(LoopHaltTest, SoIsOneOfAFreshStart) {
  const auto loop = started();
  UntypedFrontend frontend("fake");
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    if (reading.fresh()) reading.observed[0] = std::numeric_limits<double>::infinity();
  };
  poke(frontend, 2);
  EXPECT_EQ(loop->run_granted(kAll), Step::ended);
  EXPECT_THAT(loop->fault(), HasSubstr("actuator 'left'"));
}

// ------------------------------------------------------------------------------ ends in order

/// From 0, with an acceleration of 0.01 at most, to rest.
void expect_braked(const std::vector<double>& written) {
  ASSERT_GT(written.size(), 10U);
  double before = written.front();
  for (std::size_t i = 1; i < written.size(); ++i) {
    const double step = written[i] - written[i - 1];
    EXPECT_LE(std::abs(step - before), 0.01 + 1e-9) << "row " << i;
    before = step;
  }
  EXPECT_LE(std::abs(before), 0.01 + 1e-9) << "at rest when the driver is stopped";
}

// rule H12
TEST_F(LoopHaltTest, AStopBrakesWithinTheLimitsAndThenStopsTheDriver) {
  for (const bool robot_is_done : {false, true}) {
    FakeDriver::calls = {};
    FakeDriver::limits = {.speed = 1000.0, .acceleration = 1e6};  // of iterations: 0.1 and 0.01
    std::vector<double> written;
    FakeDriver::on_write = [&](const Desired<FakeDriver>& desired) {
      written.push_back(desired[0]);
    };
    Loop loop = timed_loop();
    FakeDriver::on_read = [&](Reading<FakeDriver>& reading) {
      if (written.empty() || written.back() < 5.0) return;
      robot_is_done ? reading.finish() : loop.ask_to_stop();
    };
    loop.start();
    UntypedFrontend frontend("fake");
    send(frontend, 0, 1000.0, {.pace = speed(1000.0), .profile = Profile::linear});
    EXPECT_TRUE(loop.run().in_order);
    EXPECT_EQ(FakeDriver::calls.stopped, 1);
    expect_braked(written);
  }
}

TEST_F(LoopHaltTest, ARobotThatDoesNothingIsStoppedAtOnce) {
  Loop loop = timed_loop();
  loop.start();
  loop.ask_to_stop();
  EXPECT_TRUE(loop.run().in_order);
  EXPECT_EQ(FakeDriver::calls.written, 0);
}

// rule H12
TEST_F(LoopHaltTest, BrakingThatTakesTooLongIsCut) {
  FakeDriver::limits = {.speed = 1000.0, .acceleration = 1.0};  // a quarter of an hour to stop
  Loop loop = timed_loop();
  loop.start();
  std::int64_t requested = 0;
  std::thread user([&] {
    UntypedFrontend frontend("fake");
    send(frontend, 0, 1e6, {.pace = speed(1000.0), .profile = Profile::linear});
    frontend.wait_for(15'000, kPatience);
    requested = monotonic_now();
    loop.ask_to_stop();
  });
  EXPECT_TRUE(loop.run().in_order);
  const std::int64_t took = monotonic_now() - requested;
  user.join();
  EXPECT_GT(took, 900'000'000);
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

// rule H13
TEST_F(LoopHaltTest, AFailedVerbLeavesNoTimeForBraking) {
  FakeDriver::limits = {.speed = 1000.0, .acceleration = 1.0};
  Loop loop = timed_loop({{"fails", "write"}});
  loop.start();
  const int before = FakeDriver::calls.written;
  EXPECT_FALSE(loop.run().in_order);
  EXPECT_EQ(FakeDriver::calls.written - before, 3);
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

// ------------------------------------------------------------------------- readings

/// A bursting fake driver that is commanded, halted and resumed; its sensor may lie.
class ReadingTest : public LoopHaltTest {
 protected:
  void begin(const Limits& limits) {
    frontend_.reset();
    loop_.reset();
    FakeDriver::limits = limits;
    FakeDriver::on_write = [this](const Desired<FakeDriver>& desired) { written_ = desired[0]; };
    FakeDriver::on_read = [this](Reading<FakeDriver>& reading) {
      reading.observed[0] += moved_ + offset_ + (reading.fresh() ? fresh_offset_ : 0.0);
    };
    loop_ = started();
    frontend_ = std::make_unique<UntypedFrontend>("fake");
  }
  void run(int iterations) {
    frontend_->start_burst(iterations);
    loop_->run_granted(kAll);
  }
  std::uint64_t halt() {
    const std::uint64_t number = frontend_->halt("");
    run(1);
    return number;
  }
  Handle resume(std::uint64_t number) {
    const Batch batch = send_resume(*frontend_, number);
    loop_->run_granted(kAll);
    return batch.handle(0);
  }
  bool is_alive() { return loop_->fault().empty(); }

  std::unique_ptr<Loop> loop_;
  std::unique_ptr<UntypedFrontend> frontend_;
  double written_ = 0.0;
  double moved_ = 0.0;         // by hand, or noise
  double offset_ = 0.0;        // of every reading
  double fresh_offset_ = 0.0;  // of the reading of a fresh start
};

// rule R2
TEST_F(ReadingTest, AResumeRefusesOneThatCannotBe) {
  Dice dice(3);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double period = 1e-3;
  for (int i = 0; i < cases(63); ++i) {
    Limits limits{.minimum = -5.0, .maximum = 5.0, .speed = dice.real(0.5, 4.0)};
    if (i % 2 == 0) limits.error = dice.real(0.1, 1.0);
    begin(limits);
    offset_ = fresh_offset_ = moved_ = 0.0;
    add(*frontend_, 0, dice.real(-2.0, 2.0), {.pace = iterations(20)});
    run(static_cast<int>(dice.real(1.0, 30.0)));
    const std::uint64_t number = halt();
    run(static_cast<int>(dice.real(1.0, 5.0)));

    const double tolerance = limits.speed * period + (i % 2 == 0 ? limits.error / 10.0 : 0.0);
    const double sizes[] = {2.1 * tolerance, 10.0 * tolerance, 10.0,        1e6,
                            1e300,           kInfinity,        std::nan("")};
    const double wrong = std::copysign(sizes[i % 7], dice.real(-1.0, 1.0));
    const int when = i % 3;
    if (when == 0) fresh_offset_ = wrong;
    if (when == 1) offset_ = wrong;  // of the last row, and from then on
    if (when == 2) {                 // of one row
      offset_ = wrong;
      run(1);
      offset_ = 0.0;
    } else {
      run(1);
    }
    const double before = written_;
    const Handle handle = resume(number);
    run(3);
    EXPECT_EQ(written_, before);
    ASSERT_TRUE(is_alive());
    if (when == 2) {
      // it has come back by itself, or will in the next row
      if (handle.status != Status::completed) {
        EXPECT_EQ(resume(number).status, Status::completed) << resume(number).text;
      }
    } else {
      EXPECT_EQ(handle.status, Status::rejected) << i;
      EXPECT_TRUE(frontend_->halted());
      offset_ = fresh_offset_ = 0.0;
      run(1);
      const std::uint64_t again = frontend_->halted()->number;
      EXPECT_EQ(resume(again).status, Status::completed) << i << ": " << resume(again).text;
    }
    EXPECT_EQ(written_, before);
  }
}

// rule R5
TEST_F(ReadingTest, ARobotThatIsRightIsNeverRefused) {
  Dice dice(5);
  for (int i = 0; i < cases(20); ++i) {
    const Limits limits{.speed = dice.real(0.5, 4.0), .error = dice.real(0.1, 1.0)};
    begin(limits);
    double place = 0.0;
    const std::uint64_t number = halt();
    const double motion = dice.real(-1.0, 1.0) * limits.speed * 1e-3;
    const double noise = limits.error / 20.0;
    for (int k = 0; k < 50; ++k) {
      place += motion;
      moved_ = place + dice.real(-noise, noise);
      run(1);
    }
    const Handle handle = resume(number);
    EXPECT_EQ(handle.status, Status::completed) << handle.text;
    moved_ = 0.0;
  }
}

TEST_F(ReadingTest, ARobotThatCollidedResumesWhereItIs) {
  begin({.speed = 2.0, .acceleration = 15.0, .error = 0.05});
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    reading.observed[0] = std::min(reading.observed[0], 0.3);
  };
  add(*frontend_, 0, 1.0);
  run(1000);
  ASSERT_TRUE(frontend_->halted()) << "it is held back";
  EXPECT_EQ(frontend_->halted()->cause, HaltCause::error);
  run(1000);
  const Handle handle = resume(frontend_->halted()->number);
  EXPECT_EQ(handle.status, Status::completed) << handle.text;
}

// rule R6
TEST_F(ReadingTest, ARobotThatCannotBeReadInAResumeStaysHalted) {
  begin({});
  const std::uint64_t number = halt();
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    if (reading.fresh()) throw std::runtime_error("the cable is off");
  };
  const Handle handle = resume(number);
  EXPECT_EQ(handle.status, Status::rejected);
  EXPECT_THAT(handle.text, HasSubstr("the cable is off"));
  EXPECT_TRUE(frontend_->halted());
  run(2);
  EXPECT_EQ(FakeDriver::calls.halted, 2) << "the driver had resumed";
  FakeDriver::on_read = {};
  EXPECT_EQ(resume(frontend_->halted()->number).status, Status::completed);
  EXPECT_TRUE(is_alive());
}

// rule R2
TEST_F(ReadingTest, RowZeroInRealTimeIsReadUntilTwoReadingsAgree) {
  FakeDriver::limits = {.speed = 2.0};
  int reads = 0;
  const auto start = [&](double every, bool accepts) {
    FakeDriver::on_read = [&reads, every](Reading<FakeDriver>& reading) {
      if (reads++ == 0 || every != 0.0) reading.observed[0] = 7.0 + every * reads;
    };
    reads = 0;
    const auto loop =
        started({}, {.segment = "fake", .period = 100'000, .accept_reading = accepts});
    return UntypedFrontend("fake").latest().iteration();
  };
  EXPECT_EQ(start(0.0, false), 0);
  EXPECT_EQ(reads, 3) << "the second differs from the first, the third agrees";
  try {
    start(5.0, false);
    FAIL();
  } catch (const DriverError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("actuator 'left' was read at"),
                                    HasSubstr("start with --accept-reading")));
  }
  EXPECT_EQ(start(5.0, true), 0);
  EXPECT_EQ(reads, 1);
}

// ------------------------------------------------------------------------- gaps

/// A loop in real time whose driver stalls once, in iteration 20.
class GapTest : public LoopHaltTest {
 protected:
  std::string cause_after(const std::function<void()>& stall, std::int64_t gap) {
    FakeDriver::on_write = [&](const Desired<FakeDriver>& desired) {
      if (desired.iteration() == 20) stall();
    };
    const auto loop = started({}, {.segment = "fake", .period = 1'000'000, .gap = gap});
    std::thread runner([&] { static_cast<void>(loop->run()); });
    UntypedFrontend frontend("fake");
    const Iteration later = frontend.wait_for(25, kPatience).iteration();
    const auto halt = frontend.halted();
    loop->ask_to_stop();
    runner.join();
    EXPECT_GE(later, 25);
    return halt ? std::string(halt->reason()) : "";
  }
};

// rule R1
TEST_F(GapTest, ADriverDescribesAShorterOne) {
  const auto hang = [] { std::this_thread::sleep_for(std::chrono::milliseconds(300)); };
  EXPECT_THAT(cause_after(hang, 250'000'000),
              AllOf(HasSubstr("no iteration for "), HasSubstr("longer than --gap 0.25")));
  EXPECT_EQ(cause_after(hang, 0), "");
  FakeDriver::own_gap = 250'000'000;
  EXPECT_THAT(cause_after(hang, -1), HasSubstr("longer than --gap 0.25"));
  FakeDriver::simulated = false;
  EXPECT_THAT(cause_after(hang, -1), HasSubstr("longer than --gap 0.1 s:"))
      << "the default is less";
  FakeDriver::own_gap = 50'000'000;
  EXPECT_THAT(cause_after(hang, -1), HasSubstr("longer than --gap 0.05"));
  EXPECT_EQ(cause_after(hang, 3'600'000'000'000), "") << "an option has the last word";
}

}  // namespace
}  // namespace o80::test
