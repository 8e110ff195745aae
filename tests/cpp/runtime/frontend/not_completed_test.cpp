#include "o80/runtime/not_completed.hpp"

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using NotCompletedTraces = ManualBackendTest;

class NotCompletedTest : public ManualBackendTest {
 protected:
  ManualBackend manual_;
  ManualBackend& started_ = manual_.start();  // before the frontends
  UntypedFrontend one_{"pair"};
  UntypedFrontend two_{"pair"};
};

// rule S4
TEST_F(NotCompletedTest, ACommandThatAnotherFrontendOverwroteIsAnError) {
  const Batch mine = send(one_, 1, 9.0, {.pace = iterations(9)});
  manual_.run(2);
  send(two_, 1, 5.0, {.mode = Mode::overwrite});
  manual_.run(1);
  try {
    mine.wait(kAtOnce);
    FAIL() << "it was overwritten";
  } catch (const NotCompleted& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("'elbow' was overwritten by a command of another "
                                              "frontend in iteration 3"),
                                    HasSubstr("check=False")));
    ASSERT_EQ(error.ends().size(), 1U);
    EXPECT_EQ(error.ends()[0].handle.status, Status::overwritten);
    EXPECT_EQ(error.ends()[0].handle.iteration, 3);
    EXPECT_THAT(error.ends()[0].actuators, ElementsAre("elbow"));
    EXPECT_EQ(error.observation().iteration(), 3);
    EXPECT_EQ(desired(error.observation(), 1), 5.0);
  }
  mine.wait(kAtOnce, {}, {.check = false});
}

// rule S4
TEST_F(NotCompletedTraces, OneThatTheSameFrontendOverwroteIsNone) {
  play(R"(a = 0 to 9 over 9; run 2; b = 0 to 5 over 2 overwrite; run 1; a overwritten; a waits
    0 to 1 over 9; 0 to 2 overwrite; both = pulse; run 1
    both overwritten; both waits  # by a later one of its own batch)");
}

TEST_F(NotCompletedTraces, OneThatASetPointOfTheSameFrontendWaitedToOverwriteIsNone) {
  play(R"(a = 0 to 5 overwrite at 4; b = 0 to 9 over 9; run 4; b overwritten; b waits
    c = 0 to 9 over 9; run 1; B: d = 0 to 5 overwrite; run 1; c waits was overwritten)");
}

TEST_F(NotCompletedTraces, AnOverwriteOfAnotherActuatorOrAnEarlierOneDoesNotExcuse) {
  play(R"(a = 0 to 1 overwrite; b = 0 to 9 over 9; c = 1 to 1 overwrite; run 2
    B: d = 0 to 5 overwrite; run 1; b waits 'shoulder' was overwritten)");
}

TEST_F(NotCompletedTraces, ACommandOfSeveralActuatorsNamesThemAll) {
  play(R"(a = 0,1 to 9 9 over 9; run 2; B: b = 1 to 5 overwrite; run 9
    a waits 'shoulder', 'elbow' were overwritten
    c = 0,1 to 9 9 over 9; run 2; d = 1 to 5 overwrite; run 9; c waits)");
}

TEST_F(NotCompletedTraces, APurgeOfAnybodyIsAnError) {
  play(R"(a = 0 to 9 over 9; run 1; B: b = purge; run 1
    a waits 'shoulder' was purged in iteration 2; b waits
    c = 0 to 9 over 9; run 1; d = purge own; run 1; c waits was purged)");
}

TEST_F(NotCompletedTraces, SoIsAFreshStart) {
  play(R"(a = 0 to 9 over 9; run 1; B: b = reset 0; run 2
    a waits 'shoulder' was purged; a waits fresh start)");
}

TEST_F(NotCompletedTraces, SoIsACommandThatIsTooLate) {
  play(R"(run 5; a = 1 to 1 until 3; run 1; a waits 'elbow' was rejected; a waits came after)");
}

TEST_F(NotCompletedTraces, SoIsABatchThatIsTooLate) {
  play(R"(run 5; a = 1 to 1 at 3; run 1
    a waits the batch sent to 'pair' was rejected: it came after)");
}

TEST_F(NotCompletedTraces, SoIsARequestThatIsRejected) {
  play(R"(0 to 1; refuse; a = pulse; run 1; a waits 1 of 2 commands
    a waits request 'refuse' was rejected; a waits it does not want to)");
}

TEST_F(NotCompletedTraces, ListsFiveEndsAtMost) {
  std::string seven;
  for (int i = 0; i < 7; ++i) seven += "0 to 1 over 9;";
  play(seven +
       "a = pulse; run 1; B: b = purge; run 1; a waits 7 of 7 commands; a waits and 2 more");
}

// rule S4
TEST_F(NotCompletedTraces, AHaltIsAnErrorOfItsOwn) {
  play(R"(a = 0 to 9 over 9; run 1; B: halt the ball is on the floor; run 1
    a raises BackendHalted the ball)");
}

TEST_F(NotCompletedTest, AnEmptyPulseAndWaitIsNoAnswerOfABackendThatHasEnded) {
  EXPECT_EQ(one_.pulse_and_wait(kAtOnce).iteration(), 0);
  manual_.backend.end(BackendState::stopped);
  EXPECT_THROW(one_.pulse_and_wait(kAtOnce), BackendStopped);
}

TEST_F(NotCompletedTest, PulseAndWaitOfABurstingBackendThrowsToo) {
  BurstingBackend bursting("burster", [](ManualBackend& manual) {
    manual.before_publish = [&manual] {
      if (manual.backend.iteration() == 4) manual.backend.interrupt(0);
    };
  });
  UntypedFrontend frontend("burster");
  add(frontend, 0, 9.0, {.pace = iterations(9)});
  EXPECT_THAT(message_of<NotCompleted>([&] { frontend.pulse_and_wait(kPatience); }),
              HasSubstr("'shoulder' was interrupted by the driver in iteration 4"));
  add(frontend, 0, 9.0, {.pace = until(2)});
  EXPECT_EQ(frontend.pulse_and_wait(kPatience, {}, {}, {.check = false}).iteration(), 5);
}

}  // namespace
}  // namespace o80::test
