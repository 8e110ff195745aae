// Halts at iteration level: when they act, what they end and what is refused.

#include <gmock/gmock.h>

#include "control/sending/batch_builder.hpp"
#include "o80/base/error.hpp"
#include "runtime/station.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using HaltTest = StationTest;

std::uint32_t halted_in_row(const UntypedFrontend& frontend, Iteration k) {
  return frontend.wait_for(k, kAtOnce).head().halted;
}

// rules H3, H6
TEST_F(HaltTest, ActsInTheFirstStepBegunAfterIt) {
  StartedStation station;
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
  StartedStation station;
  UntypedFrontend reader("pair", {.access = Access::read_only});
  EXPECT_THROW(reader.halt("no"), ReadOnly);
  EXPECT_FALSE(reader.halted());
}

// rule H7
TEST_F(HaltTest, CommandsAreRejectedWithCauseIterationAndWho) {
  StartedStation station;
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

TEST_F(HaltTest, NoRequestIsServedThatWasSentAfterAHaltInTheSameStep) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  Batch request;
  station.on_refuse = [&] {
    frontend.halt("in the middle of a step");
    add_request(frontend, Break{});
    request = frontend.pulse();
  };
  add_request(frontend, Refuse{});
  const Batch scheduled = frontend.pulse({.at = 2});
  station.run(2);
  EXPECT_EQ(request.handle(0).status, Status::halted);
}

// rule H4
TEST_F(HaltTest, EndsWhatWasSentBeforeItWhereverItIs) {
  StartedStation station;
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
  StartedStation station;
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
  const Batch resumed = send_resume(frontend, 1);
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

// rule H1
TEST_F(HaltTest, NobodysExclusiveControlStopsIt) {
  play(R"(take; 0 to 9 over 9; a = pulse; run 2; B: halt; run 1; a.1 halted)");
}

// rule H1
TEST_F(HaltTest, NeedsNoLane) {
  play({.segment = "pair", .lanes = 1}, "a = 0 to 9 over 9; run 1; B: halt; run 1; a halted");
}

// rule H3
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
  StartedStation station;
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

// rule H8
TEST_F(HaltTest, OfTheBackendForAnotherReasonIsAnotherOne) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  station.backend.halt(HaltCause::driver, "the belt slipped");
  station.run(1);
  ASSERT_EQ(frontend.halted()->number, 1U);
  for (int i = 0; i < 3; ++i) {
    station.backend.halt(HaltCause::driver, "a person is in the cell");
    station.run(1);
    EXPECT_EQ(frontend.halted()->number, 2U);
    EXPECT_EQ(frontend.halted()->reason(), "a person is in the cell");
  }
  const Batch resume = send_resume(frontend, 1);
  station.run(1);
  EXPECT_EQ(resume.handle(0).status, Status::rejected);
  EXPECT_THAT(resume.handle(0).text, HasSubstr("halt 2 came after it"));
}

TEST_F(HaltTest, AStatusBearsNoReasonOfALaterHalt) {
  StartedStation station;
  UntypedFrontend frontend("pair");
  const auto ended_by = [&](const char* why) {
    const Batch batch = send(frontend, 0, 9.0, {.pace = iterations(9)});
    station.run(2);
    frontend.halt(why);
    station.run(1);
    return batch;
  };
  const Batch first = ended_by("the first");
  const Batch refused = send(frontend, 0, 1.0);
  station.run(1);
  send_resume(frontend, 1);
  station.run(1);
  const Batch second = ended_by("the second");
  for (const Handle& handle : {first.handle(0), refused.handle(0)}) {
    EXPECT_EQ(handle.reason, Reason::halted);
    EXPECT_EQ(handle.text, "the backend was halted") << "by which one is no longer known";
  }
  EXPECT_THAT(second.handle(0).text, HasSubstr("the second"));
  // asked for, and not acting yet: it has ended nothing
  frontend.halt("the third");
  const Batch third = send(frontend, 0, 1.0);
  EXPECT_EQ(third.handle(0).status, Status::queued);
  station.run(1);
  EXPECT_THAT(third.handle(0).text, HasSubstr("the third"));
}

// rule L8
TEST_F(HaltTest, ARobotThatIsNotWhereItShouldBeHalts) {
  StartedStation station({.segment = "pair"},
                         [](Schema& schema) { schema.actuator(1).limits({.error = 0.25}); });
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
  StartedStation station({.segment = "pair"},
                         [](Schema& schema) { schema.actuator(1).limits({.error = 1e9}); });
  station.before_publish = [&] { station.now[1] = std::nan(""); };
  station.run(2);
  EXPECT_TRUE(UntypedFrontend("pair").halted());
}

}  // namespace
}  // namespace o80::test
