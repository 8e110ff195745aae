// How a loop halts, resumes and stops in order, with a driver that can fail in each of its verbs.

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <thread>

#include "memory/verb_word.hpp"
#include "robot/loop.hpp"
#include "robot/puppet.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class LoopHaltTest : public PuppetTest {
 protected:
  static std::unique_ptr<Loop> bursting_loop(const OptionValues& options = {}) {
    auto loop = std::make_unique<Loop>(std::make_unique<DriverInstance>(table(), options),
                                       BackendOptions{.segment = "puppet", .bursting = true});
    loop->start();
    return loop;
  }
  static Loop timed_loop() {
    return {std::make_unique<DriverInstance>(table(), OptionValues{}),
            BackendOptions{.segment = "puppet", .period = 100'000}};
  }
};

TEST_F(LoopHaltTest, ADriverHaltsWithItsReading) {
  const auto loop = bursting_loop();
  Puppet::on_read = [](Reading<Puppet>& reading) {
    if (reading.iteration() >= 3) reading.halt("the belt slipped");
  };
  UntypedFrontend frontend("puppet");
  add(frontend, 0, 10.0, {.pace = iterations(10)});
  frontend.start_burst(10);
  EXPECT_EQ(loop->run_granted(kAll), Step::standing);
  EXPECT_EQ(frontend.published(), 3);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->cause, HaltCause::driver);
  EXPECT_EQ(frontend.halted()->number, 1U);
  EXPECT_EQ(frontend.halted()->reason(), "the belt slipped");
  EXPECT_EQ(Puppet::calls.halted, 1) << "the driver is told that a halt begins";
}

TEST_F(LoopHaltTest, ADriverMayRefuseToResume) {
  const auto loop = bursting_loop();
  UntypedFrontend frontend("puppet");
  const std::uint64_t number = frontend.halt("");
  loop->run_granted(kAll);
  const auto resume = [&] {
    BatchBuilder builder;
    builder.resume(number);
    const Batch batch = frontend.pulse(builder);
    loop->run_granted(kAll);
    return batch.handle(0);
  };
  Puppet::on_resume = [] { return Served::rejected("the door is open"); };
  EXPECT_EQ(resume().text, "the door is open");
  EXPECT_TRUE(frontend.halted());
  Puppet::on_resume = {};
  EXPECT_EQ(resume().status, Status::completed);
  EXPECT_FALSE(frontend.halted());
  EXPECT_EQ(frontend.latest().head().fresh, 1U);
  EXPECT_EQ(Puppet::calls.halted, 1);
  EXPECT_EQ(Puppet::calls.resumed, 2);
}

TEST_F(LoopHaltTest, ADriverThatFailsToHaltEndsTheLoop) {
  const auto loop = bursting_loop({{"fails", "halt"}});
  UntypedFrontend frontend("puppet");
  frontend.halt("");
  EXPECT_EQ(loop->run_granted(kAll), Step::ended);
  EXPECT_THAT(loop->fault(), AllOf(HasSubstr("failed in halt"), HasSubstr("no brake")));
  EXPECT_EQ(Puppet::calls.stopped, 1);
}

// ------------------------------------------------------------------------------ readings

TEST_F(LoopHaltTest, AFirstReadingThatIsNoNumberIsAFaultThatNamesIt) {
  Puppet::on_read = [](Reading<Puppet>& reading) {
    reading.observed[1] = std::numeric_limits<double>::quiet_NaN();
  };
  EXPECT_THAT(message_of<DriverError>([] { bursting_loop(); }),
              AllOf(HasSubstr("actuator 'right'"), HasSubstr("is NaN or infinite")));
  EXPECT_EQ(Puppet::calls.stopped, 1);
}

TEST_F(LoopHaltTest, SoIsOneOfAFreshStart) {
  const auto loop = bursting_loop();
  UntypedFrontend frontend("puppet");
  Puppet::on_read = [](Reading<Puppet>& reading) {
    if (reading.fresh()) reading.observed[0] = std::numeric_limits<double>::infinity();
  };
  add_request(frontend, Poke{.how = 2});
  frontend.pulse();
  EXPECT_EQ(loop->run_granted(kAll), Step::ended);
  EXPECT_THAT(loop->fault(), HasSubstr("actuator 'left'"));
}

// ------------------------------------------------------------------------------ ends in order

TEST_F(LoopHaltTest, AStopBrakesWithinTheLimitsAndThenStopsTheDriver) {
  Puppet::limits = {.speed = 1000.0, .acceleration = 1e6};  // of iterations: 0.1 and 0.01
  std::vector<double> written;
  Puppet::on_write = [&](const Desired<Puppet>& desired) { written.push_back(desired[0]); };
  Loop loop = timed_loop();
  loop.start();
  std::thread user([&] {
    UntypedFrontend frontend("puppet");
    send(frontend, 0, 1000.0, {.pace = speed(1000.0), .profile = Profile::linear});
    while (frontend.latest().iteration() < 200 || desired(frontend.latest()) < 5.0) {
    }
    loop.ask_to_stop();
  });
  const Ended ended = loop.run();
  user.join();
  EXPECT_TRUE(ended.in_order);
  EXPECT_EQ(Puppet::calls.stopped, 1);
  ASSERT_GT(written.size(), 10U);
  double before = written.front();  // from 0
  for (std::size_t i = 1; i < written.size(); ++i) {
    const double step = written[i] - written[i - 1];
    EXPECT_LE(std::abs(step - before), 0.01 + 1e-9) << "row " << i;
    before = step;
  }
  EXPECT_LE(std::abs(before), 0.01 + 1e-9) << "at rest when the driver is stopped";
}

TEST_F(LoopHaltTest, ARobotThatIsDoneBrakesBeforeItIsStopped) {
  Puppet::limits = {.speed = 1000.0, .acceleration = 1e6};  // of iterations: 0.1 and 0.01
  std::vector<double> written;
  Puppet::on_write = [&](const Desired<Puppet>& desired) { written.push_back(desired[0]); };
  Puppet::on_read = [&](Reading<Puppet>& reading) {
    if (!written.empty() && written.back() > 5.0) reading.finish();
  };
  Loop loop = timed_loop();
  loop.start();
  UntypedFrontend frontend("puppet");
  send(frontend, 0, 1000.0, {.pace = speed(1000.0), .profile = Profile::linear});
  EXPECT_TRUE(loop.run().in_order);
  ASSERT_GT(written.size(), 10U);
  double before = written.front();  // from 0
  for (std::size_t i = 1; i < written.size(); ++i) {
    const double step = written[i] - written[i - 1];
    EXPECT_LE(std::abs(step - before), 0.01 + 1e-9) << "row " << i;
    before = step;
  }
  EXPECT_LE(std::abs(before), 0.01 + 1e-9) << "at rest when the driver is stopped";
  EXPECT_EQ(Puppet::calls.stopped, 1);
}

TEST_F(LoopHaltTest, ARobotThatDoesNothingIsStoppedAtOnce) {
  Loop loop = timed_loop();
  loop.start();
  loop.ask_to_stop();
  EXPECT_TRUE(loop.run().in_order);
  EXPECT_EQ(Puppet::calls.written, 0);
}

TEST_F(LoopHaltTest, BrakingThatTakesTooLongIsCut) {
  Puppet::limits = {.speed = 1000.0, .acceleration = 1.0};  // a quarter of an hour to stop
  Loop loop = timed_loop();
  loop.start();
  std::int64_t asked = 0;
  std::thread user([&] {
    UntypedFrontend frontend("puppet");
    send(frontend, 0, 1e6, {.pace = speed(1000.0), .profile = Profile::linear});
    frontend.wait_for(15'000, kPatience);
    asked = monotonic_now();
    loop.ask_to_stop();
  });
  EXPECT_TRUE(loop.run().in_order);
  const std::int64_t took = monotonic_now() - asked;
  user.join();
  EXPECT_GT(took, 900'000'000);
  EXPECT_EQ(Puppet::calls.stopped, 1);
}

TEST_F(LoopHaltTest, AFailedVerbLeavesNoTimeForBraking) {
  Puppet::limits = {.speed = 1000.0, .acceleration = 1.0};
  Loop loop(std::make_unique<DriverInstance>(table(), OptionValues{{"fails", "write"}}),
            BackendOptions{.segment = "puppet", .period = 100'000});
  loop.start();
  const int before = Puppet::calls.written;
  EXPECT_FALSE(loop.run().in_order);
  EXPECT_EQ(Puppet::calls.written - before, 3);
  EXPECT_EQ(Puppet::calls.stopped, 1);
}

// ------------------------------------------------------------------------------ verbs that hang

TEST_F(LoopHaltTest, AVerbThatDoesNotReturnIsSeenFromOutside) {
  std::atomic<bool> hangs{true};
  Puppet::on_write = [&](const Desired<Puppet>& desired) {
    while (desired.iteration() == 2 && hangs) std::this_thread::yield();
  };
  Loop loop = timed_loop();
  loop.start();
  std::thread runner([&] { static_cast<void>(loop.run()); });
  const AttachedSegment observer =
      AttachedSegment::attach("puppet", Access::read_only, Deadline(kPatience));
  SlowVerb slow;
  while (slow.verb != Verb::write || monotonic_now() - slow.since < 50'000'000) {
    slow = slow_verb(observer.view());
  }
  EXPECT_EQ(to_text(slow.verb), "write");
  hangs = false;
  loop.ask_to_stop();
  runner.join();
}

}  // namespace
}  // namespace o80::test
