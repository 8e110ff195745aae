// How a halt is cleared, and what is served until then.

#include <atomic>
#include <cmath>
#include <thread>

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using ResumeTest = ManualBackendTest;

void limit_shoulder(Schema& schema) {
  schema.actuator(0).limits({.speed = 100.0, .acceleration = 10'000.0});  // 0.1, 0.01 an iteration
}

// rule H10
TEST_F(ResumeTest, StartsAfreshFromWhereTheRobotIs) {
  play(R"(a = 0 to 10 over 10; run 3; halt; run 1; read 0 1.5; read 1 -2.5  # somebody moved it
    r = resume 1; run 1; r completed @5; row 5 fresh; 0 rows 5: 1.5; 1 rows 5: -2.5; running
    row 6 free; b = 0 to 2.5; run 1; b completed)");
}

TEST_F(ResumeTest, OfAHaltThatWasRequestedInTheSameStepClearsIt) {
  // a scheduled request is served after the step has polled for halts, and before it takes batches
  play(R"(while refused halt; while refused r = resume 1; a = refuse at 2; b = 0 to 10 over 10
    run 2; r completed; b halted; running; run 1; row 4 free  # the halt acts no more)");
}

// rule H10
TEST_F(ResumeTest, IsRefusedUntilTheRobotHasBraked) {
  // a backend that stands still latches a halt without an iteration in which it could brake
  play({.segment = "pair", .bursting = true}, R"(0 to 10 fastest; burst 5; halt; drive
    r = resume 1; drive; r rejected; r says still brakes; halted
    burst 10; r = resume 1; drive; r completed; running)",
       limit_shoulder);
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

TEST_F(ResumeTest, NamesAHaltHoweverSoonItIsSent) {
  play({.segment = "pair"}, R"(halt; r = resume 1; run 1; r completed; running
    a = 0 to 10 fastest; run 5; halt; r = resume 2; run 1; r says still brakes; halted)",
       limit_shoulder);
}

/// A halt in iteration 21 of a shoulder that needs ten iterations to rest.
class MovingTest : public ManualBackendTest {
 protected:
  MovingTest() {
    send(frontend, 0, 1e6, {.pace = speed(100.0), .profile = Profile::linear});
    manual.run(20);
    number = frontend.halt("");
  }
  /// What it says, while another thread iterates.
  std::string resume(const KeepWaiting& keep_waiting = {}) {
    std::atomic<bool> over{false};
    std::thread loop([&] {
      while (!over) {
        manual.iterate();
        std::this_thread::yield();
      }
    });
    std::string refused =
        message_of<Error>([&] { frontend.resume(number, kPatience, keep_waiting); });
    over = true;
    loop.join();
    return refused;
  }

  StartedBackend manual{{.segment = "pair"}, limit_shoulder};
  UntypedFrontend frontend{"pair"};
  std::uint64_t number = 0;
};

TEST_F(MovingTest, IsWaitedForByAResume) {
  EXPECT_EQ(resume(), "");
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

TEST_F(MovingTest, AResumeCanBeCalledOffHoweverFastRowsCome) {
  EXPECT_EQ(resume([]() -> bool { throw Error("Ctrl-C"); }), "Ctrl-C");
  EXPECT_TRUE(frontend.halted());
}

TEST_F(MovingTest, AResumeSaysWhatItWaitsFor) {
  EXPECT_THAT(message_of<TimeoutError>([&] { frontend.resume(number, kAtOnce); }),
              HasSubstr("is not in force yet"));
  manual.run(1);
  EXPECT_THAT(message_of<TimeoutError>([&] { frontend.resume(number, kAtOnce); }),
              HasSubstr("still brakes"));
}

TEST_F(ResumeTest, NeedsNoControl) {
  play(R"(a = take; run 1; B: halt; run 1; B: r = resume 1; run 1; r completed; B: b = 0 to 1; run 1
    b rejected exclusive  # control stays with its holder)");
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
