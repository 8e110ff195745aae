// Halts at iteration level: when they act, what they end, what is refused, and how they are
// cleared.

#include <gmock/gmock.h>

#include <cmath>
#include <thread>

#include "memory/child_process.hpp"
#include "o80/base/error.hpp"
#include "o80/control/batch_builder.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using HaltTest = StationTest;

std::uint32_t halted_in_row(const UntypedFrontend& frontend, Iteration k) {
  return frontend.wait_for(k, kAtOnce).head().halted;
}

TEST_F(HaltTest, ActsInTheFirstStepBegunAfterIt) {
  Station station;
  station.start();
  UntypedFrontend commander("pair");
  UntypedFrontend other("pair");
  add(commander, 0, 10.0, {.pace = iterations(10)});
  add(commander, 0, 20.0);
  const Batch batch = commander.pulse();
  station.run(3);
  const std::uint64_t number = other.halt("the ball is on the floor");
  EXPECT_EQ(number, 1U);
  ASSERT_TRUE(other.halted());
  EXPECT_EQ(other.halted()->iteration, -1) << "asked for, not acting yet";
  station.run(2);
  EXPECT_EQ(batch.handle(0).status, Status::halted);
  EXPECT_EQ(batch.handle(0).iteration, 4);
  EXPECT_EQ(batch.handle(1).status, Status::halted);
  EXPECT_THAT(desired(commander, 3, 5), ::testing::Each(desired(commander.wait_for(3, kAtOnce))))
      << "a position without limits stops in one iteration";
  EXPECT_EQ(halted_in_row(other, 3), 0U);
  EXPECT_EQ(halted_in_row(other, 4), 1U);
  EXPECT_EQ(halted_in_row(other, 5), 1U);
  for (const FrontendOptions& options : {FrontendOptions{}, {.access = Access::read_only}}) {
    const UntypedFrontend reader("pair", options);
    const auto halt = reader.halted();
    ASSERT_TRUE(halt);
    EXPECT_EQ(halt->number, number);
    EXPECT_EQ(halt->cause, HaltCause::frontend);
    EXPECT_EQ(halt->iteration, 4);
    EXPECT_THAT(std::string(halt->who_text()), HasSubstr("pid " + std::to_string(getpid())));
    EXPECT_EQ(halt->reason(), "the ball is on the floor");
  }
}

TEST_F(HaltTest, AReadOnlyFrontendMayNotHalt) {
  Station station;
  station.start();
  UntypedFrontend reader("pair", {.access = Access::read_only});
  EXPECT_THROW(reader.halt("no"), ReadOnly);
  EXPECT_FALSE(reader.halted());
}

TEST_F(HaltTest, CommandsAreRejectedWithCauseIterationAndWho) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  frontend.halt("enough");
  station.run(1);
  const Batch batch = send(frontend, 0, 5.0);
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_EQ(batch.handle(0).reason, Reason::halted);
  EXPECT_THAT(batch.handle(0).text,
              AllOf(HasSubstr("since iteration 1"), HasSubstr("cause frontend"),
                    HasSubstr("pid " + std::to_string(getpid())), HasSubstr("enough")));
  EXPECT_THROW(frontend.wait_for_end(batch, kPatience), BackendHalted);
  EXPECT_EQ(desired(frontend.latest()), 0.0);
}

TEST_F(HaltTest, EndsWhatWasSentBeforeItWhereverItIs) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  const Batch running = send(frontend, 0, 9.0, {.pace = iterations(9)});
  add(frontend, 1, 1.0);
  const Batch scheduled = frontend.pulse({.at = 20});
  // so large that it is staged over several iterations
  for (int i = 0; i < 3000; ++i) add(frontend, 1, i);
  const Batch large = frontend.pulse();
  station.run(2);
  const Batch in_the_lane = send(frontend, 1, 7.0);
  frontend.halt("");
  station.run(1);
  EXPECT_EQ(running.handle(0).status, Status::halted);
  EXPECT_EQ(scheduled.handle(0).status, Status::halted);
  EXPECT_EQ(scheduled.handle(0).iteration, 3);
  station.run(20);
  EXPECT_EQ(in_the_lane.handle(0).status, Status::halted);
  EXPECT_EQ(large.handle(0).status, Status::halted);
  EXPECT_EQ(large.handle(2999).status, Status::halted);
  EXPECT_EQ(desired(frontend.latest(), 1), 0.0);
}

TEST_F(HaltTest, WhatWasSentBeforeItNeverActsAlsoAfterTheResume) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  BatchBuilder late;
  send(frontend, 1, 0.0);
  frontend.halt("");
  station.run(1);
  // drawn before the halt acts, committed long after
  AttachedSegment segment =
      AttachedSegment::attach("pair", Access::read_write, Deadline(kPatience));
  LaneSender sender(segment);
  RecordHead head;
  head.pace = Pace::direct;
  const double target = 4.0;
  late.command(head, std::as_bytes(std::span(&target, 1)));
  BatchRecord record;
  record.id = sender.next_id();
  sender.draw_ids(record.id + 3);
  frontend.forget_added();
  BatchBuilder resume;
  resume.resume(1);
  const Batch resumed = frontend.pulse(resume);
  station.run(1);
  EXPECT_EQ(resumed.handle(0).status, Status::completed) << resumed.handle(0).text;
  EXPECT_FALSE(frontend.halted());
  const auto blocks = late.seal(record);
  sender.send(std::as_bytes(blocks), offsetof(BatchRecord, ticket));
  // as if its ticket had been drawn before the halt
  const std::uint64_t early = 0;
  auto* words = reinterpret_cast<std::uint64_t*>(segment.view().transport(sender.lane()));
  std::atomic_ref(words[offsetof(BatchRecord, ticket) / 8]).store(early);
  station.run(2);
  EXPECT_EQ(static_cast<Status>(sender.status(record_id(record.id, 0)).word.status),
            Status::halted);
  EXPECT_EQ(desired(frontend.latest()), 0.0);
}

TEST_F(HaltTest, NobodysExclusiveControlStopsIt) {
  Station station;
  station.start();
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  holder.add_take_control();
  add(holder, 0, 9.0, {.pace = iterations(9)});
  const Batch batch = holder.pulse();
  station.run(2);
  other.halt("stop it");
  station.run(1);
  EXPECT_EQ(batch.handle(1).status, Status::halted);
}

TEST_F(HaltTest, NeedsNoLane) {
  Station station({.segment = "pair", .lanes = 1});
  station.start();
  UntypedFrontend holder("pair");
  const Batch batch = send(holder, 0, 9.0, {.pace = iterations(9)});
  station.run(1);
  UntypedFrontend other("pair");
  other.halt("");
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::halted);
}

TEST_F(HaltTest, IsLatchedBeforeRowZero) {
  Station station;
  halt("pair", "not today", kPatience);
  station.start();
  UntypedFrontend frontend("pair");
  EXPECT_EQ(halted_in_row(frontend, 0), 1U);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->reason(), "not today");
}

TEST_F(HaltTest, IsTheBackendsOwnTooAndOnceForEachCause) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  for (int i = 0; i < 3; ++i) {
    station.backend.halt(HaltCause::driver, "motor 3 is hot");
    station.run(1);
  }
  const auto halt = frontend.halted();
  ASSERT_TRUE(halt);
  EXPECT_EQ(halt->number, 1U);
  EXPECT_EQ(halt->cause, HaltCause::driver);
  EXPECT_EQ(halt->who_text(), "");
  EXPECT_EQ(halt->reason(), "motor 3 is hot");
}

TEST_F(HaltTest, ARobotThatIsNotWhereItShouldBeHalts) {
  Station station({.segment = "pair"},
                  [](Schema& schema) { schema.actuator(1).limits({.error = 0.25}); });
  station.start();
  UntypedFrontend frontend("pair");
  station.before_publish = [&] {
    if (station.backend.iteration() == 3) station.now[1] = 0.75;  // it hit something
  };
  const Batch batch = send(frontend, 1, 1.0, {.pace = iterations(10)});
  station.run(4);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->cause, HaltCause::error);
  EXPECT_EQ(frontend.halted()->iteration, 3 + 1);
  EXPECT_THAT(std::string(frontend.halted()->reason()),
              AllOf(HasSubstr("actuator 'elbow'"), HasSubstr("observed at 0.75"),
                    HasSubstr("desired at 0.3"), HasSubstr("0.25")));
  EXPECT_EQ(batch.handle(0).status, Status::halted);
}

TEST_F(HaltTest, AReadingThatIsNoNumberHaltsWhereThereIsAnErrorLimit) {
  Station station({.segment = "pair"},
                  [](Schema& schema) { schema.actuator(1).limits({.error = 1e9}); });
  station.start();
  station.before_publish = [&] { station.now[1] = std::nan(""); };
  station.run(2);
  EXPECT_TRUE(UntypedFrontend("pair").halted());
}

// ------------------------------------------------------------------------------ resuming

TEST_F(HaltTest, ResumeStartsAfreshFromWhereTheRobotIs) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  send(frontend, 0, 10.0, {.pace = iterations(10)});
  station.run(3);
  const std::uint64_t number = frontend.halt("");
  station.run(1);
  station.now = {1.5, -2.5};  // somebody moved it
  BatchBuilder builder;
  builder.resume(number);
  const Batch resume = frontend.pulse(builder);
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

TEST_F(HaltTest, ResumeIsRefusedUntilTheRobotHasBraked) {
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

TEST_F(HaltTest, ResumeClearsNoHaltThatCameAfterTheOneItNames) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  frontend.halt("first");
  station.run(1);
  frontend.halt("second");
  station.run(1);
  for (const std::uint64_t number : {1, 3}) {
    BatchBuilder builder;
    builder.resume(number);
    const Batch resume = frontend.pulse(builder);
    station.run(1);
    EXPECT_EQ(resume.handle(0).status, Status::rejected);
    EXPECT_THAT(resume.handle(0).text,
                HasSubstr(number == 1 ? "halt 2 came after it" : "there is no halt 3"));
    ASSERT_TRUE(frontend.halted());
  }
  EXPECT_EQ(frontend.halted()->reason(), "second");
}

TEST_F(HaltTest, WinsOverAResumeInTheSameIteration) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  const std::uint64_t number = frontend.halt("");
  BatchBuilder builder;
  builder.resume(number);
  const Batch resume = frontend.pulse(builder);
  station.run(1);
  EXPECT_EQ(resume.handle(0).status, Status::rejected);
  EXPECT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.latest().head().halted, 1U);
}

TEST_F(HaltTest, ResumeWithoutAHaltChangesNothing) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  const Batch running = send(frontend, 0, 9.0, {.pace = iterations(9)});
  BatchBuilder builder;
  builder.resume(7);
  const Batch resume = frontend.pulse(builder);
  station.run(3);
  EXPECT_EQ(resume.handle(0).status, Status::completed);
  EXPECT_EQ(running.handle(0).status, Status::active);
}

TEST_F(HaltTest, RequestsMarkedForItAreServedTheOthersRejected) {
  Station station;
  station.start();
  UntypedFrontend frontend("pair");
  frontend.halt("");
  station.run(1);
  add_request(frontend, Reset{.seed = 5});
  const Batch marked = frontend.pulse();
  add_request<Refuse>(frontend);
  const Batch other = frontend.pulse();
  station.run(1);
  EXPECT_EQ(marked.handle(0).status, Status::completed);
  EXPECT_EQ(other.handle(0).status, Status::rejected);
  EXPECT_EQ(other.handle(0).reason, Reason::halted);
  EXPECT_EQ(desired(frontend.latest()), 5.0) << "a plant that was reset is where it is";
  EXPECT_TRUE(frontend.halted()) << "and the halt stands";
}

// ------------------------------------------------------------------------------ bursting

TEST_F(HaltTest, EndsABurstAfterTheIterationUnderWay) {
  BurstingStation bursting("pair", [](Station& station) {
    station.before_publish = [&station] {
      if (station.backend.iteration() == 5) station.backend.halt(HaltCause::driver, "five");
    };
  });
  UntypedFrontend frontend("pair");
  add(frontend, 0, 100.0, {.pace = iterations(100)});
  EXPECT_THAT(message_of<BackendHalted>([&] { frontend.burst(100, kPatience); }),
              AllOf(HasSubstr("ended in iteration 5"), HasSubstr("five")));
  EXPECT_EQ(frontend.published(), 5);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->iteration, 6) << "the next one, that has not begun";
}

TEST_F(HaltTest, EndsAPulseAndWait) {
  BurstingStation bursting("pair", [](Station& station) {
    station.before_publish = [&station] {
      if (station.backend.iteration() == 5) station.backend.halt(HaltCause::driver, "five");
    };
  });
  UntypedFrontend frontend("pair");
  add(frontend, 0, 100.0, {.pace = iterations(100)});
  EXPECT_THROW(frontend.pulse_and_wait(kPatience), BackendHalted);
  EXPECT_EQ(frontend.published(), 5);
}

TEST_F(HaltTest, BurstsAreServedWhileHalted) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  frontend.halt("");
  const auto row = frontend.burst(3, kPatience);
  EXPECT_EQ(row.iteration(), 3);
  EXPECT_EQ(row.head().halted, 1U);
  add(frontend, 0, 1.0);
  EXPECT_THAT(message_of<BackendHalted>([&] { frontend.burst(1, kPatience); }),
              HasSubstr("rejected"));
  EXPECT_EQ(frontend.published(), 3);
  frontend.resume(frontend.halted()->number, kPatience);
  EXPECT_FALSE(frontend.halted());
  add(frontend, 0, 1.0);
  EXPECT_EQ(desired(frontend.burst(1, kPatience)), 1.0);
}

TEST_F(HaltTest, IsSeenByABackendThatStandsStill) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 9.0, {.pace = iterations(9)});
  frontend.burst(2, kPatience);
  const Batch waiting = send(frontend, 0, 3.0);
  frontend.halt("");
  waiting.wait(kPatience);
  EXPECT_EQ(waiting.handle(0).status, Status::halted);
}

// ------------------------------------------------------------------------------ those who are
// killed

TEST_F(HaltTest, StandsWhenWhoAskedIsKilled) {
  Station station;
  station.start();
  ChildProcess child([](const ChildProcess::Ready& ready) {
    halt("pair", "my last word", kPatience);
    ready();
    pause_for_ever();
  });
  ASSERT_TRUE(child.wait_until_ready());
  child.kill_now();
  station.run(1);
  UntypedFrontend frontend("pair");
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->reason(), "my last word");
}

// ------------------------------------------------------------------------------ successors

enum class Before { idle, acting, halted, asked, resumed, stopped, failed };

/// Leaves a backend in some state and dies.
void live_and_die(Before before, const ChildProcess::Ready& ready, bool bursting = false) {
  Station station({.segment = "pair", .bursting = bursting});
  station.start();
  UntypedFrontend frontend("pair");
  const auto iterate = [&] {
    if (bursting) frontend.start_burst(1);
    station.iterate();
  };
  iterate();
  if (before == Before::acting) {
    send(frontend, 0, 100.0, {.pace = iterations(100)});
    iterate();
  }
  if (before == Before::halted || before == Before::resumed) {
    frontend.halt("me");
    iterate();
  }
  if (before == Before::resumed) {
    BatchBuilder builder;
    builder.resume(1);
    frontend.pulse(builder);
    iterate();
    if (frontend.halted()) return;  // without a word
    iterate();
  }
  if (before == Before::asked) frontend.halt("me");
  if (before == Before::stopped) station.backend.end(State::stopped);
  if (before == Before::failed) station.backend.end(State::failed, "broken");
  ready();
  pause_for_ever();
}

std::optional<Halt> halt_of_successor(Before before, BackendOptions options = {.segment = "pair"},
                                      bool was_bursting = false) {
  ChildProcess child(
      [&](const ChildProcess::Ready& ready) { live_and_die(before, ready, was_bursting); });
  EXPECT_TRUE(child.wait_until_ready());
  child.kill_now();
  Station station(options);
  station.start();
  UntypedFrontend frontend("pair");
  const auto halt = frontend.halted();
  EXPECT_EQ(halted_in_row(frontend, 0), halt ? 1U : 0U);
  if (halt) {
    const Batch batch = send(frontend, 0, 1.0);
    station.run(1);
    EXPECT_EQ(batch.handle(0).status, Status::rejected);
  }
  return halt;
}

TEST_F(HaltTest, TheSuccessorOfABackendThatWasKilledWhileItActedStartsHalted) {
  const auto halt = halt_of_successor(Before::acting);
  ASSERT_TRUE(halt);
  EXPECT_EQ(halt->cause, HaltCause::predecessor);
  EXPECT_THAT(std::string(halt->reason()), HasSubstr("killed while commands acted"));
}

TEST_F(HaltTest, TheSuccessorOfAHaltedBackendStartsHalted) {
  for (const Before before : {Before::halted, Before::asked}) {
    const auto halt = halt_of_successor(before);
    ASSERT_TRUE(halt);
    EXPECT_EQ(halt->cause, HaltCause::predecessor);
    EXPECT_THAT(std::string(halt->reason()), HasSubstr("never resumed"));
  }
}

TEST_F(HaltTest, SoDoesTheSuccessorOfThatOne) {
  ChildProcess child(
      [&](const ChildProcess::Ready& ready) { live_and_die(Before::halted, ready); });
  ASSERT_TRUE(child.wait_until_ready());
  child.kill_now();
  // this one does not live to publish a row
  ChildProcess second([&](const ChildProcess::Ready& ready) {
    Station station;
    ready();
    pause_for_ever();
  });
  ASSERT_TRUE(second.wait_until_ready());
  second.kill_now();
  Station station;
  station.start();
  EXPECT_TRUE(UntypedFrontend("pair").halted());
}

TEST_F(HaltTest, OtherSuccessorsDoNot) {
  EXPECT_FALSE(halt_of_successor(Before::idle));
  EXPECT_FALSE(halt_of_successor(Before::resumed));
  EXPECT_FALSE(halt_of_successor(Before::stopped));
  EXPECT_FALSE(halt_of_successor(Before::failed));
  EXPECT_FALSE(halt_of_successor(Before::halted, {.segment = "pair", .resume = true}));
  EXPECT_FALSE(halt_of_successor(Before::acting, {.segment = "pair", .resume = true}));
  EXPECT_FALSE(halt_of_successor(Before::acting, {.segment = "pair"}, true)) << "a simulation died";
}

}  // namespace
}  // namespace o80::test
