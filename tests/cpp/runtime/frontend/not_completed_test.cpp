#include "o80/runtime/not_completed.hpp"

#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class NotCompletedTest : public StationTest {
 protected:
  /// What a wait for the batch throws.
  static std::string told(const Batch& batch) {
    return message_of<NotCompleted>([&] { batch.wait(kAtOnce); });
  }

  Station station_;
  Station& started_ = station_.start();  // before the frontends
  UntypedFrontend one_{"pair"};
  UntypedFrontend two_{"pair"};
};

// rule S4
TEST_F(NotCompletedTest, ACommandThatAnotherFrontendOverwroteIsAnError) {
  const Batch mine = send(one_, 1, 9.0, {.pace = iterations(9)});
  station_.run(2);
  send(two_, 1, 5.0, {.mode = Mode::overwrite});
  station_.run(1);
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
TEST_F(NotCompletedTest, OneThatTheSameFrontendOverwroteIsNone) {
  const Batch first = send(one_, 0, 9.0, {.pace = iterations(9)});
  station_.run(2);
  send(one_, 0, 5.0, {.pace = iterations(2), .mode = Mode::overwrite});
  station_.run(1);
  ASSERT_EQ(first.handle(0).status, Status::overwritten);
  first.wait(kAtOnce);

  add(one_, 0, 1.0, {.pace = iterations(9)});
  add(one_, 0, 2.0, {.mode = Mode::overwrite});
  const Batch both = one_.pulse();
  station_.run(1);
  ASSERT_EQ(both.handle(0).status, Status::overwritten) << "by a later one of its own batch";
  both.wait(kAtOnce);
}

TEST_F(NotCompletedTest, OneThatASetPointOfTheSameFrontendWaitedToOverwriteIsNone) {
  add(one_, 0, 5.0, {.mode = Mode::overwrite});
  one_.pulse({.at = 4});
  const Batch mine = send(one_, 0, 9.0, {.pace = iterations(9)});
  station_.run(4);
  ASSERT_EQ(mine.handle(0).status, Status::overwritten);
  mine.wait(kAtOnce);
  const Batch next = send(one_, 0, 9.0, {.pace = iterations(9)});
  station_.run(1);
  send(two_, 0, 5.0, {.mode = Mode::overwrite});
  station_.run(1);
  EXPECT_THAT(told(next), HasSubstr("was overwritten"));
}

TEST_F(NotCompletedTest, AnOverwriteOfAnotherActuatorOrAnEarlierOneDoesNotExcuse) {
  send(one_, 0, 1.0, {.mode = Mode::overwrite});
  const Batch mine = send(one_, 0, 9.0, {.pace = iterations(9)});
  send(one_, 1, 1.0, {.mode = Mode::overwrite});
  station_.run(2);
  send(two_, 0, 5.0, {.mode = Mode::overwrite});
  station_.run(1);
  EXPECT_THAT(told(mine), HasSubstr("'shoulder' was overwritten"));
}

TEST_F(NotCompletedTest, ACommandOfSeveralActuatorsNamesThemAll) {
  const std::array<std::uint32_t, 2> actuators{0, 1};
  const std::array<double, 2> targets{9.0, 9.0};
  one_.add_commands(actuators, std::as_bytes(std::span(targets)), {.pace = iterations(9)});
  const Batch group = one_.pulse();
  station_.run(2);
  send(two_, 1, 5.0, {.mode = Mode::overwrite});
  station_.run(9);
  EXPECT_THAT(told(group), HasSubstr("'shoulder', 'elbow' were overwritten"));

  one_.add_commands(actuators, std::as_bytes(std::span(targets)), {.pace = iterations(9)});
  const Batch next = one_.pulse();
  station_.run(2);
  send(one_, 1, 5.0, {.mode = Mode::overwrite});
  station_.run(9);
  next.wait(kAtOnce);
}

TEST_F(NotCompletedTest, APurgeOfAnybodyIsAnError) {
  const Batch mine = send(one_, 0, 9.0, {.pace = iterations(9)});
  station_.run(1);
  two_.add_purge();
  const Batch purge = two_.pulse();
  station_.run(1);
  EXPECT_THAT(told(mine), HasSubstr("'shoulder' was purged in iteration 2"));
  purge.wait(kAtOnce);
  const Batch again = send(one_, 0, 9.0, {.pace = iterations(9)});
  station_.run(1);
  one_.add_purge_own();
  one_.pulse();
  station_.run(1);
  EXPECT_THAT(told(again), HasSubstr("was purged"));
}

TEST_F(NotCompletedTest, SoIsAFreshStart) {
  const Batch mine = send(one_, 0, 9.0, {.pace = iterations(9)});
  station_.run(1);
  add_request(two_, Reset{});
  two_.pulse();
  station_.run(2);
  EXPECT_THAT(told(mine), HasSubstr("'shoulder' was purged"));
  EXPECT_THAT(told(mine), HasSubstr("fresh start"));
}

TEST_F(NotCompletedTest, SoIsACommandThatIsTooLate) {
  station_.run(5);
  const Batch mine = send(one_, 1, 1.0, {.pace = until(3)});
  station_.run(1);
  EXPECT_THAT(told(mine), AllOf(HasSubstr("'elbow' was rejected"), HasSubstr("came after")));
}

TEST_F(NotCompletedTest, SoIsABatchThatIsTooLate) {
  station_.run(5);
  add(one_, 1, 1.0);
  const Batch mine = one_.pulse({.at = 3});
  station_.run(1);
  EXPECT_THAT(told(mine), HasSubstr("the batch sent to 'pair' was rejected: it came after"));
}

TEST_F(NotCompletedTest, SoIsARequestThatIsRejected) {
  add(one_, 0, 1.0);
  add_request(one_, Refuse{});
  const Batch mine = one_.pulse();
  station_.run(1);
  EXPECT_THAT(told(mine), AllOf(HasSubstr("1 of 2 commands"),
                                HasSubstr("request 'refuse' was "
                                          "rejected"),
                                HasSubstr("it does not want to")));
}

TEST_F(NotCompletedTest, ListsFiveEndsAtMost) {
  for (int i = 0; i < 7; ++i) add(one_, 0, i, {.pace = iterations(9)});
  const Batch mine = one_.pulse();
  station_.run(1);
  two_.add_purge();
  two_.pulse();
  station_.run(1);
  EXPECT_THAT(told(mine), AllOf(HasSubstr("7 of 7 commands"), HasSubstr("and 2 more")));
}

// rule S4
TEST_F(NotCompletedTest, AHaltIsAnErrorOfItsOwn) {
  const Batch mine = send(one_, 0, 9.0, {.pace = iterations(9)});
  station_.run(1);
  two_.halt("the ball is on the floor");
  station_.run(1);
  EXPECT_THAT(message_of<BackendHalted>([&] { mine.wait(kAtOnce); }),
              HasSubstr("the ball is on the floor"));
}

TEST_F(NotCompletedTest, AnEmptyPulseAndWaitIsNoAnswerOfABackendThatHasEnded) {
  EXPECT_EQ(one_.pulse_and_wait(kAtOnce).iteration(), 0);
  station_.backend.end(BackendState::stopped);
  EXPECT_THROW(one_.pulse_and_wait(kAtOnce), BackendStopped);
}

TEST_F(NotCompletedTest, PulseAndWaitOfABurstingBackendThrowsToo) {
  BurstingStation bursting("burster", [](Station& station) {
    station.before_publish = [&station] {
      if (station.backend.iteration() == 4) station.backend.interrupt(0);
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
