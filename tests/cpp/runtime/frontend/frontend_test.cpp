#include "o80/runtime/frontend.hpp"

#include <atomic>
#include <optional>

#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class FrontendTest : public ManualBackendTest {};

// ------------------------------------------------------------------------------ adding

TEST_F(FrontendTest, RefusesWhatTheRobotCannotFollowWhenItIsAdded) {
  auto [manual, frontend] = StartedPair({.segment = "pair"}, [](Schema& schema) {
    schema.actuator(1).limits({.minimum = -1, .maximum = 1, .speed = 10});
  });
  const auto refusal = [&](auto&& call) { return message_of<InvalidArgument>(call); };
  EXPECT_THAT(refusal([&] { add(frontend, 1, 1.5); }), HasSubstr("elbow"));
  EXPECT_NE(refusal([&] { add(frontend, 1, 0.5, {.pace = speed(11)}); }), "");
  EXPECT_THAT(refusal([&] { add(frontend, 2, 0.5); }), HasSubstr("shoulder (0), elbow (1)"));
  EXPECT_THAT(refusal([&] { static_cast<void>(frontend.actuator("elbwo")); }),
              HasSubstr("there are: shoulder, elbow. Did you mean 'elbow'?"));
  EXPECT_NE(refusal([&] { add(frontend, 0, 0.5, {.pace = iterations(0)}); }), "");
  EXPECT_NE(refusal([&] { add(frontend, 0, 0.5, {.pace = duration(-std::chrono::seconds(1))}); }),
            "");
  EXPECT_NE(refusal([&] { add(frontend, 0, 0.5, {.pace = until(-1)}); }), "");
  EXPECT_THAT(refusal([&] { static_cast<void>(frontend.request_index("dance")); }),
              HasSubstr("reset, snapshot, restore, refuse, break"));
  EXPECT_THAT(refusal([&] { static_cast<void>(frontend.request_index("rest")); }),
              HasSubstr("Did you mean 'reset'?"));
  EXPECT_EQ(frontend.added(), 0U);
}

TEST_F(FrontendTest, TheLastStateOfATrajectoryIsNoDirectValue) {
  auto [manual, frontend] =
      StartedPair({.segment = "pair"}, [](Schema& schema) { schema.actuator(0).rests_at("", 0); });
  const std::array<double, 2> rows{1, 2};
  frontend.add_trajectory(0, 2, std::as_bytes(std::span(rows)), {.mode = Mode::overwrite});
  frontend.pulse();
  manual.run(3);
  EXPECT_THAT(desired(frontend, 1, 3), ElementsAre(1, 2, 0));
}

TEST_F(FrontendTest, RefusesOptionsThatContradictEachOther) {
  auto [manual, frontend] = StartedPair();
  const auto refusal = [&](const CommandOptions& options) {
    return message_of<InvalidArgument>([&] { add(frontend, 0, 1.0, options); });
  };
  EXPECT_THAT(refusal({.pace = iterations(5), .profile = Profile::as_sent}),
              HasSubstr("without a pace"));
  EXPECT_THAT(refusal({.pace = fastest(), .profile = Profile::linear}),
              HasSubstr("has no profile"));
  EXPECT_THAT(refusal({.pace = direct(std::chrono::milliseconds(20)), .profile = Profile::as_sent}),
              HasSubstr("without every"));
  EXPECT_EQ(frontend.added(), 0U);
}

TEST_F(FrontendTest, RefusesATrajectoryWhoseTimesMakeNoSense) {
  auto [manual, frontend] = StartedPair();
  const std::array<double, 3> rows{1, 2, 4};
  constexpr std::int64_t kMs = 1'000'000;  // the period
  const auto add_with = [&](std::vector<std::int64_t> times, CommandOptions options = {}) {
    return message_of<InvalidArgument>(
        [&] { frontend.add_trajectory(0, 3, std::as_bytes(std::span(rows)), options, times); });
  };
  EXPECT_THAT(add_with({1000, 2000}), HasSubstr("3 rows needs 3 times, got 2"));
  const std::string grow = "must grow from 0, by an iteration at least: ";
  EXPECT_THAT(add_with({kMs, 3 * kMs, 2 * kMs}),
              HasSubstr(grow + "row 2 is due after 0.002 s, the row before after 0.003 s"));
  EXPECT_THAT(add_with({kMs, kMs, 2 * kMs}), HasSubstr(grow + "row 1 is"));
  EXPECT_THAT(add_with({0, kMs, 2 * kMs}), HasSubstr(grow + "row 0 is due after 0 s"));
  EXPECT_THAT(add_with({kMs, 2 * kMs, 2 * kMs + kMs / 4}), HasSubstr("in the same iteration of"));
  EXPECT_EQ(add_with({kMs * 6 / 10, kMs * 16 / 10, 3 * kMs}), "") << "an iteration each";
  EXPECT_THAT(add_with({}, {.pace = duration(std::chrono::seconds(1))}), HasSubstr("times"));
  EXPECT_THAT(add_with({}, {.pace = until(9)}), HasSubstr("one target"));
  EXPECT_EQ(add_with({1'000'000, 2'000'000, 4'000'000}), "");
}

// ------------------------------------------------------------------------------ sending

TEST_F(FrontendTest, AnEmptyBatchReturnsAtOnce) {
  auto [manual, frontend] = StartedPair();
  const Batch batch = frontend.pulse();
  EXPECT_TRUE(batch.empty());
  EXPECT_TRUE(batch.ended());
  batch.wait(std::nullopt);
  EXPECT_EQ(batch.first_iteration(), -1);
  EXPECT_EQ(batch.rejection(), "");
}

// rule B6
TEST_F(FrontendTest, AFullLaneIsAnErrorAndNothingIsSentAndNothingIsLost) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .lane_blocks = 64});
  for (int i = 0; i < 40; ++i) add(frontend, 0, i, {.pace = iterations(2)});
  const Batch first = frontend.pulse();
  for (int i = 0; i < 40; ++i) add(frontend, 1, i);
  manual.run(1);
  for (int tries = 0; tries < 1000; ++tries) {
    ASSERT_THAT(message_of<LaneFull>([&] { frontend.pulse(); }),
                AllOf(HasSubstr("takes 41 blocks"), HasSubstr("of 60 are free"),
                      HasSubstr("Nothing was sent")));
  }
  EXPECT_EQ(frontend.added(), 40U);
  EXPECT_EQ(desired(frontend.latest(), 1), 0);
  manual.run(44);
  const Batch second = frontend.pulse();
  manual.run(60);
  EXPECT_EQ(desired(frontend.latest(), 1), 39);
  EXPECT_TRUE(second.ended());
  EXPECT_EQ(first.handle(39).status, Status::completed) << "refused pulses age no status";
  EXPECT_EQ(second.handle(39).status, Status::completed);
}

// rule B6
TEST_F(FrontendTest, ALaneFullOfCommandsStillTakesAPurge) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .lane_blocks = 16});
  Batch endless;
  const auto fill = [&] {
    while (true) {
      add(frontend, 0, 1.0, {.pace = iterations(1'000'000)});
      endless = frontend.pulse();
    }
  };
  EXPECT_THROW(fill(), LaneFull);
  frontend.forget_added();
  frontend.add_purge(kEveryActuator);
  frontend.pulse();
  manual.run(1);
  EXPECT_EQ(endless.handle(0).status, Status::purged);
  send(frontend, 0, 2.0);
  manual.run(1);
  EXPECT_EQ(desired(frontend.latest()), 2.0);
}

TEST_F(FrontendTest, ALaneFullOfWhatIsScheduledStillTakesABurst) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .bursting = true, .lane_blocks = 16});
  const auto fill = [&] {
    while (true) {
      add(frontend, 0, 3.0);
      frontend.pulse({.at = 2});
    }
  };
  EXPECT_THROW(fill(), LaneFull);
  frontend.forget_added();
  const Burst burst = frontend.start_burst(2);
  while (!burst.done()) manual.iterate();
  EXPECT_EQ(desired(frontend.latest()), 3.0);
}

TEST_F(FrontendTest, ABatchLargerThanItsLaneSaysHowToSendIt) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .lane_blocks = 64});
  for (int i = 0; i < 64; ++i) add(frontend, 0, i);
  EXPECT_THAT(message_of<LaneFull>([&] { frontend.pulse(); }),
              AllOf(HasSubstr("has 60"), HasSubstr("in parts")));
  frontend.forget_added();
  send(frontend, 0, 1.0);
  manual.run(1);
  EXPECT_EQ(desired(frontend.latest()), 1.0);
}

TEST_F(FrontendTest, ClosedItRefusesAllAndGivesItsLaneBack) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .lanes = 1});
  const Batch batch = send(frontend, 0, 1.0, {.pace = iterations(2)});
  frontend.close();
  EXPECT_TRUE(frontend.closed());
  EXPECT_THAT(message_of<Closed>([&] { add(frontend, 0, 1.0); }), HasSubstr("open a new one"));
  EXPECT_THROW(static_cast<void>(frontend.latest()), Closed);
  EXPECT_THROW(static_cast<void>(frontend.history(3)), Closed);
  UntypedFrontend next("pair");
  send(next, 1, 2.0);
  manual.run(2);
  EXPECT_EQ(desired(next.latest(), 0), 1.0) << "sent motion goes on";
  EXPECT_EQ(desired(next.latest(), 1), 2.0);
  EXPECT_EQ(batch.handle(0).status, Status::completed) << "a kept batch still answers";
}

// ------------------------------------------------------------------------------ reading

// rule O5
TEST_F(FrontendTest, ReadsRowsByTheirIteration) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .history = 10});
  manual.run(25);
  EXPECT_EQ(frontend.published(), 25);
  EXPECT_EQ(frontend.oldest(), 16);
  EXPECT_EQ(frontend.wait_for(16, kAtOnce).iteration(), 16);
  EXPECT_THAT(message_of<RowOverwritten>([&] { frontend.wait_for(15, kAtOnce); }),
              AllOf(HasSubstr("row 15"), HasSubstr("oldest one is 16")));
  EXPECT_THAT(message_of<TimeoutError>([&] { frontend.wait_for(26, kAtOnce); }),
              HasSubstr("it is at row 25"));
  EXPECT_THROW(frontend.wait_for(-1, kAtOnce), InvalidArgument);

  const Rows rows = frontend.history(4);
  EXPECT_EQ(rows.first, 22);
  ASSERT_EQ(rows.count, 4U);
  EXPECT_EQ(unpack<RowHead>(rows.row(3).data()).iteration, 25);
  EXPECT_EQ(frontend.history(100).count, 10U);
  EXPECT_EQ(frontend.history(0).count, 0U);
  EXPECT_EQ(frontend.history(18, 20).count, 3U);
  EXPECT_EQ(frontend.history(0, 17).first, 16);
  EXPECT_EQ(frontend.history(20, 99).count, 6U);
  EXPECT_EQ(frontend.history(90, 99).count, 0U);
}

TEST_F(FrontendTest, ReadsOneRowAfterTheOtherAndCountsWhatItMissed) {
  StartedBackend manual({.segment = "pair", .history = 5});
  const UntypedFrontend frontend("pair");
  UntypedObservation row(frontend.description());
  Iteration position = 0;
  EXPECT_EQ(frontend.wait_for_next(position, row.bytes(), kAtOnce), 0);
  EXPECT_EQ(position, 1);
  manual.run(20);
  EXPECT_EQ(frontend.wait_for_next(position, row.bytes(), kAtOnce), 15);
  EXPECT_EQ(row.iteration(), 16);
  EXPECT_EQ(frontend.wait_for_next(position, row.bytes(), kAtOnce), 0);
  EXPECT_EQ(row.iteration(), 17);
  position = 21;
  EXPECT_THROW(frontend.wait_for_next(position, row.bytes(), kAtOnce), TimeoutError);
  EXPECT_EQ(position, 21);
}

// rule O6
TEST_F(FrontendTest, AReaderThatIsOvertakenAllTheTimeStillReadsTrueRowsInOrder) {
  StartedBackend manual({.segment = "pair", .history = 1});
  const UntypedFrontend frontend("pair");
  std::atomic<bool> done{false};
  std::thread reader([&] {
    UntypedObservation row(frontend.description());
    Iteration position = 0;
    std::int64_t missed = 0;
    std::int64_t read = 0;
    while (position <= 20'000) {
      missed += frontend.wait_for_next(position, row.bytes(), kPatience);
      ++read;
      ASSERT_EQ(row.iteration(), position - 1);
      ASSERT_EQ(read + missed, position);
      ASSERT_LE(row.iteration(), frontend.published());
    }
    done = true;
  });
  while (!done) manual.iterate();
  reader.join();
}

TEST_F(FrontendTest, WaitsEndWithAnErrorThatSaysWhatBecameOfTheBackend) {
  std::optional<ManualBackend> manual(std::in_place);
  manual->start();
  UntypedFrontend frontend("pair");
  const Batch batch = send(frontend, 0, 1.0, {.pace = iterations(50)});
  manual->run(1);
  std::thread ender([&] { manual->backend.end(BackendState::failed, "the motor is hot"); });
  EXPECT_THAT(message_of<BackendFailed>([&] { frontend.wait_for(99, kPatience); }),
              AllOf(HasSubstr("pair"), HasSubstr("the motor is hot")));
  EXPECT_THROW(batch.wait(kPatience), BackendFailed);
  ender.join();
  EXPECT_EQ(frontend.latest().iteration(), 1) << "its history can still be read";
  EXPECT_EQ(frontend.life(), Life::failed);
  manual.reset();
  EXPECT_EQ(frontend.history(10).count, 2U);
  EXPECT_THROW(UntypedFrontend("pair", {.timeout = kPatience}), BackendFailed);
  const UntypedFrontend late("pair", {.timeout = kPatience, .dead = true});
  EXPECT_EQ(late.latest().iteration(), 1);
}

}  // namespace
}  // namespace o80::test
