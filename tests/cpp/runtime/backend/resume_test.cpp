// How a halt is cleared, and what is served until then.

#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <thread>

#include "control/sending/batch_builder.hpp"
#include "o80/base/error.hpp"
#include "runtime/station.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using ::testing::HasSubstr;
using ResumeTest = StationTest;

// rule H10
TEST_F(ResumeTest, StartsAfreshFromWhereTheRobotIs) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  send(frontend, 0, 10.0, {.pace = iterations(10)});
  station.run(3);
  const std::uint64_t number = frontend.halt("");
  station.run(1);
  station.now = {1.5, -2.5};  // somebody moved it
  const Batch resume = send_resume(frontend, number);
  station.run(1);
  EXPECT_EQ(resume.handle(0).status, Status::completed);
  const auto fresh = frontend.wait_for(resume.handle(0).iteration, kAtOnce);
  EXPECT_EQ(fresh.head().fresh, 1U);
  EXPECT_EQ(fresh.head().halted, 0U);
  EXPECT_EQ(desired(fresh), 1.5);
  EXPECT_EQ(desired(fresh, 1), -2.5);
  EXPECT_FALSE(frontend.halted());
  EXPECT_EQ(frontend.latest().head().halted, 0U);
  const Batch batch = send(frontend, 0, 2.5);
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
}

TEST_F(ResumeTest, OfAHaltThatWasRequestedInTheSameStepClearsIt) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  Batch resume;
  // a scheduled request is served after the step has looked for halts, and before it takes batches
  station.on_refuse = [&] {
    BatchBuilder builder;
    builder.resume(frontend.halt("in the middle of a step"));
    resume = frontend.pulse(builder);
  };
  add_request(frontend, Refuse{});
  const Batch scheduled = frontend.pulse({.at = 2});
  const Batch motion = send(frontend, 0, 10.0, {.pace = iterations(10)});
  station.run(2);
  EXPECT_EQ(resume.handle(0).status, Status::completed);
  EXPECT_EQ(motion.handle(0).status, Status::halted);
  EXPECT_FALSE(frontend.halted());
  station.run(1);
  EXPECT_EQ(frontend.latest().head().halted, 0U)
      << "the halt acts after its resume was reported as completed";
}

// rule H10
TEST_F(ResumeTest, IsRefusedUntilTheRobotHasBraked) {
  // a backend that stands still latches a halt without an iteration in which it could brake
  BurstingStation bursting("pair", {}, [](Schema& schema) {
    schema.actuator(0).limits({.speed = 100.0, .acceleration = 10'000.0});
  });
  UntypedFrontend frontend("pair");
  add(frontend, 0, 10.0, {.pace = fastest()});
  frontend.burst(5, kPatience);
  const double speed = desired(frontend.latest()) - desired(frontend.wait_for(4, kAtOnce));
  ASSERT_GT(speed, 0.03);
  const std::uint64_t number = frontend.halt("");
  while (frontend.halted()->iteration < 0) std::this_thread::yield();  // it is latched
  EXPECT_THAT(message_of<BackendHalted>([&] { frontend.resume(number, kPatience); }),
              HasSubstr("still brakes"));
  frontend.burst(10, kPatience);
  EXPECT_NEAR(desired(frontend.wait_for(6, kAtOnce)) - desired(frontend.wait_for(5, kAtOnce)),
              speed - 0.01, 1e-9);
  frontend.resume(number, kPatience);
  EXPECT_EQ(desired(frontend.latest()), desired(frontend.wait_for(15, kAtOnce)));
}

// rule H9
TEST_F(ResumeTest, ClearsNoHaltThatCameAfterTheOneItNames) {
  play(R"(halt; run 1; halt; run 1; r = resume 1; run 1; r rejected; r says halt 2 came after it
    halted; r = resume 3; run 1; r rejected; r says there is no halt 3; halted)");
}

// rule H9
TEST_F(ResumeTest, LosesAgainstALaterHaltInTheSameIteration) {
  play("halt; run 1; r = resume 1; halt; run 1; r rejected; halted");
}

void limit_shoulder(Schema& schema) {
  schema.actuator(0).limits({.speed = 100.0, .acceleration = 10'000.0});  // 0.1, 0.01 an iteration
}

TEST_F(ResumeTest, NamesAHaltHoweverSoonItIsSent) {
  StartedStation station({.segment = "pair"}, limit_shoulder);
  UntypedFrontend frontend("pair");
  const auto resume = [&] {
    BatchBuilder builder;
    builder.resume(frontend.halt(""));
    return frontend.pulse(builder);
  };
  const Batch at_rest = resume();
  station.run(1);
  EXPECT_EQ(at_rest.handle(0).status, Status::completed) << at_rest.handle(0).text;
  EXPECT_FALSE(frontend.halted());
  send(frontend, 0, 10.0, {.pace = fastest()});
  station.run(5);
  const Batch moving = resume();
  station.run(1);
  EXPECT_THAT(moving.handle(0).text, HasSubstr("still brakes"));
  EXPECT_TRUE(frontend.halted());
}

/// A shoulder that needs ten iterations to rest.
struct Moving {
  Moving() {
    send(frontend, 0, 1e6, {.pace = speed(100.0), .profile = Profile::linear});
    station.run(20);
  }
  /// What it says, while another thread iterates.
  std::string resume(std::uint64_t number, const KeepWaiting& keep_waiting = {}) {
    std::atomic<bool> over{false};
    std::thread loop([&] {
      while (!over) {
        station.iterate();
        std::this_thread::yield();
      }
    });
    std::string refused =
        message_of<Error>([&] { frontend.resume(number, kPatience, keep_waiting); });
    over = true;
    loop.join();
    return refused;
  }

  StartedStation station{{.segment = "pair"}, limit_shoulder};
  UntypedFrontend frontend{"pair"};
};

TEST_F(ResumeTest, OfAFrontendWaitsUntilTheRobotRests) {
  Moving moving;
  UntypedFrontend& frontend = moving.frontend;
  const std::uint64_t number = frontend.halt("the ball is on the floor");
  const std::string refused = moving.resume(number);
  EXPECT_EQ(refused, "");
  EXPECT_FALSE(frontend.halted());
  double before = 0.1;
  Iteration k = 21;
  for (; frontend.wait_for(k, kAtOnce).head().fresh == 0; ++k) {
    const double step =
        desired(frontend.wait_for(k, kAtOnce)) - desired(frontend.wait_for(k - 1, kAtOnce));
    EXPECT_LE(std::abs(step - before), 0.01 + 1e-9) << "row " << k;
    before = step;
  }
  EXPECT_GE(k, 30) << "it takes ten iterations to rest";
}

TEST_F(ResumeTest, OfAFrontendCanBeCalledOffHoweverFastRowsCome) {
  Moving moving;
  UntypedFrontend& frontend = moving.frontend;
  const std::uint64_t number = frontend.halt("");
  const std::string refused = moving.resume(number, []() -> bool { throw Error("Ctrl-C"); });
  EXPECT_EQ(refused, "Ctrl-C");
  EXPECT_TRUE(frontend.halted());
}

TEST_F(ResumeTest, OfAFrontendSaysWhatItWaitsFor) {
  Moving moving;
  UntypedFrontend& frontend = moving.frontend;
  const std::uint64_t number = frontend.halt("");
  EXPECT_THAT(message_of<TimeoutError>([&] { frontend.resume(number, kAtOnce); }),
              HasSubstr("is not in force yet"));
  moving.station.run(1);
  EXPECT_THAT(message_of<TimeoutError>([&] { frontend.resume(number, kAtOnce); }),
              HasSubstr("still brakes"));
}

TEST_F(ResumeTest, NeedsNoControl) {
  StartedStation station({.segment = "pair", .lanes = 3});
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  holder.add_take_control();
  holder.pulse();
  station.run(1);
  const std::uint64_t number = other.halt("");
  station.run(1);
  BatchBuilder mixed;
  mixed.resume(number);
  mixed.purge(kEveryActuator);
  const Batch refused = other.pulse(mixed);
  const Batch resume = send_resume(other, number);
  station.run(1);
  EXPECT_EQ(refused.handle(0).reason, Reason::exclusive) << "nothing else passes with it";
  EXPECT_EQ(resume.handle(0).status, Status::completed) << resume.handle(0).text;
  const Batch batch = send(other, 0, 1.0);
  station.run(1);
  EXPECT_EQ(batch.handle(0).reason, Reason::exclusive) << "control stays with its holder";
}

TEST_F(ResumeTest, WithoutAHaltChangesNothing) {
  play("a = 0 to 9 over 9; r = resume 7; run 3; r completed; a active");
}

// rule H7
TEST_F(ResumeTest, IsNotNeededByRequestsThatAreServedWhileHalted) {
  play(R"(halt; run 1; a = reset 5; b = refuse; run 1; a completed; b rejected halted
    0 is 5; halted  # a plant that was reset is where it is, and the halt stands)");
}

}  // namespace
}  // namespace o80::test
