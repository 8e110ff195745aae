// What the journal says of each kind of decision, read as a frontend reads it.

#include "memory/child_process.hpp"
#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using ::testing::UnorderedElementsAre;

std::vector<JournalKind> kinds_of(const std::vector<JournalEntry>& entries) {
  std::vector<JournalKind> kinds;
  for (const JournalEntry& entry : entries) kinds.push_back(entry.kind);
  return kinds;
}

std::string this_process() { return "pid " + std::to_string(getpid()); }

using JournalTraces = ManualBackendTest;

class JournalAuthorTest : public ObservedBackendTest {
 protected:
  using ObservedBackendTest::ObservedBackendTest;
  std::vector<JournalEntry> news() { return all_of(journal); }
  std::vector<JournalEntry> news_of_a_snapshot() {
    add_request<Snapshot>(commander);
    commander.pulse();
    manual.run(1);
    return news();
  }

  Journal journal{observer};
};

TEST_F(JournalTraces, AnIterationWithoutCommandsWritesNothing) { play("run 10; journal"); }

TEST_F(JournalAuthorTest, HoldsTheStateThatASnapshotKeeps) {
  for (std::size_t size = 0; size <= 20; ++size) {
    manual.kept.clear();
    for (std::size_t i = 0; i < size; ++i) manual.kept.push_back(static_cast<std::byte>(i + 1));
    manual.kept_slot = static_cast<std::uint32_t>(size);
    const std::vector<JournalEntry> entries = news_of_a_snapshot();
    if (size == 0) {
      EXPECT_THAT(kinds_of(entries), ElementsAre(JournalKind::taken, JournalKind::status));
      continue;
    }
    ASSERT_THAT(kinds_of(entries),
                ElementsAre(JournalKind::taken, JournalKind::snapshot, JournalKind::status));
    EXPECT_EQ(entries[1].kept, manual.kept);
    EXPECT_EQ(entries[1].slot, size);
    EXPECT_EQ(entries[1].iteration, entries[0].iteration);
  }
}

TEST_F(JournalAuthorTest, LeavesOutAStateThatIsLargerThanAnEntry) {
  manual.kept.resize(std::size_t{1} << 20);
  EXPECT_THAT(kinds_of(news_of_a_snapshot()), ElementsAre(JournalKind::taken, JournalKind::status));
}

TEST_F(JournalAuthorTest, ShowsWhoSentWhatAndWhenItWasTakenStartedAndEnded) {
  manual.run(2);
  add(commander, 1, 0.5, {.pace = iterations(3), .profile = Profile::linear});
  commander.pulse();
  manual.run(5);
  const std::vector<JournalEntry> entries = news();
  ASSERT_EQ(entries.size(), 3U);
  const JournalEntry& taken = entries[0];
  EXPECT_EQ(taken.iteration, 3);
  EXPECT_EQ(taken.lane, 0U);
  EXPECT_EQ(taken.owner, 1U);
  EXPECT_THAT(taken.who, HasSubstr(this_process()));
  EXPECT_EQ(taken.missed, 0U);
  EXPECT_FALSE(taken.records_lost);
  ASSERT_EQ(taken.records.size(), 1U);
  const JournalRecord& command = taken.records[0];
  EXPECT_EQ(command.kind, JournalRecord::Kind::command);
  EXPECT_EQ(command.pace.pace, Pace::iterations);
  EXPECT_EQ(command.pace.amount, 3);
  ASSERT_EQ(command.targets.size(), 1U);
  EXPECT_EQ(command.targets[0].actuator, 1U);
  EXPECT_EQ(unpack<double>(command.targets[0].states.data()), 0.5);
  for (const std::size_t status : {1, 2}) EXPECT_EQ(entries[status].id, command.id);
}

TEST_F(JournalAuthorTest, WhatABatchAnswersStandsInEachDecisionOnIt) {
  manual.run(2);
  const UntypedObservation row = commander.latest();
  const auto pulse = [&](PulseOptions options) {
    options.seen = row;
    add(commander, 0, 0.5);
    return commander.pulse(options);
  };
  pulse({});
  pulse({.at = 5});
  pulse({.at = 1});  // late
  manual.run(4);
  std::vector<std::pair<JournalKind, Iteration>> decided;
  for (const JournalEntry& entry : news()) {
    if (entry.kind == JournalKind::status) continue;
    EXPECT_EQ(entry.records.size(), 1U);
    EXPECT_EQ(entry.seen, (Seen{commander.epoch(), 2, row.time(), row.schema().head.clock, 2}));
    decided.emplace_back(entry.kind, entry.iteration);
  }
  using enum JournalKind;
  EXPECT_THAT(decided, UnorderedElementsAre(std::pair(taken, 3), std::pair(scheduled, 3),
                                            std::pair(rejected, 3), std::pair(taken, 5)));
}

TEST_F(JournalAuthorTest, ARejectedBatchComesWithItsRecordsAndAHaltWithItsText) {
  commander.halt("enough");
  manual.run(1);
  send(commander, 0, 5.0);
  manual.run(1);
  const auto entries = news();
  ASSERT_THAT(kinds_of(entries), ElementsAre(JournalKind::halt, JournalKind::rejected));
  EXPECT_EQ(entries[0].halt, 1U);
  EXPECT_EQ(entries[0].text, "enough");
  ASSERT_EQ(entries[1].records.size(), 1U);
  EXPECT_EQ(unpack<double>(entries[1].records[0].targets[0].states.data()), 5.0);
}

TEST_F(JournalTraces, ShowsAHaltAndItsResume) {
  play(R"(a = 0 to 5 over 10; run 2; halt stop; run 2; B: r = resume 1; run 1
    journal taken@1 active@1 halt@3 halted@3 taken@5 resume@5 fresh_start@5 completed@5
    halt enough; run 1; b = 0 to 1; run 1; journal halt@7 rejected:halted@8)");
}

TEST_F(JournalTraces, ABatchForLaterIsScheduledAndThenTaken) {
  play("a = 0 to 1 at 6; run 8; journal scheduled@1 taken@6 completed@6");
}

TEST_F(JournalTraces, ShowsWhoTookReleasedAndLostControl) {
  play(R"(a = take; run 1; B: b = 0 to 1; run 1
    journal taken@1 control_taken@1 completed@1 rejected:exclusive@2
    a = release; run 1; journal taken@3 control_released@3 completed@3
    a = take; run 1; close; B: b = 0 to 1; run 1
    journal taken@4 control_taken@4 completed@4 control_lost@5 taken@5 completed@5)");
}

TEST_F(JournalTraces, ShowsAnInterruptByTheDriver) {
  play(R"(a = 1 to 5 over 10; in 3 interrupt 1; run 3
    journal taken@1 active@1 interrupted@3 interrupted@3  # the decision and the status)");
}

TEST_F(JournalAuthorTest, ShowsRequestsWithTheirStructAndFreshStarts) {
  add_request(commander, Reset{.seed = 7});
  add_request(commander, Refuse{});
  commander.pulse();
  manual.run(1);
  const auto entries = news();
  ASSERT_THAT(kinds_of(entries), ElementsAre(JournalKind::taken, JournalKind::fresh_start,
                                             JournalKind::status, JournalKind::status));
  ASSERT_EQ(entries[0].records.size(), 2U);
  EXPECT_EQ(entries[0].records[0].kind, JournalRecord::Kind::request);
  EXPECT_EQ(unpack<Reset>(entries[0].records[0].payload.data()).seed, 7U);
  EXPECT_EQ(entries[0].records[1].request, 3U);
  EXPECT_EQ(entries[2].status, Status::completed);
  EXPECT_EQ(entries[3].status, Status::rejected);
  EXPECT_EQ(entries[3].reason, Reason::driver);
}

TEST_F(JournalTraces, TheEndOfTheBackendIsItsLastEntry) {
  play("a = 0 to 5 over 10; run 2; end failed hot; journal taken@1 active@1 purged@3 ended@3");
}

TEST_F(JournalAuthorTest, ReadsOnFromANumberWithoutLosingRecords) {
  add(commander, 0, 1.0);
  commander.pulse({.at = 4});
  manual.run(1);
  const auto before = news();
  ASSERT_EQ(before.size(), 1U);
  manual.run(5);
  Journal other(observer);
  other.seek(before.back().number + 1);
  const auto after = all_of(other);
  ASSERT_FALSE(after.empty());
  EXPECT_EQ(after[0].kind, JournalKind::taken);
  EXPECT_EQ(after[0].records.size(), 1U);
  EXPECT_EQ(after[0].missed, 0U);
  other.seek_end();
  EXPECT_TRUE(all_of(other).empty());
}

TEST_F(JournalTraces, OfManyRejectedCommandsTheBatchIsOneEntry) {
  std::string many;
  for (int i = 0; i < 500; ++i) many += "0 to 1;";
  play("halt; run 1; journal halt@1;" + many + "a = pulse; run 10; journal rejected:halted@2");
}

// ------------------------------------------------------------------------------ size

class SmallJournalTest : public JournalAuthorTest {
 protected:
  SmallJournalTest() : JournalAuthorTest({.segment = "pair", .lane_blocks = 16384, .journal = 1}) {}
};

TEST_F(SmallJournalTest, ABatchLargerThanHalfOfItIsRefusedBeforeItIsSent) {
  const auto add_many = [&](int count) {
    for (int i = 0; i < count; ++i) add(commander, 0, i);
  };
  add_many(4096);
  const std::string why = message_of<InvalidArgument>([&] { commander.pulse(); });
  EXPECT_THAT(why, HasSubstr("this batch takes 262208 bytes"));
  EXPECT_THAT(why, HasSubstr("the journal of 'pair' allows 262144"));
  EXPECT_THAT(why, HasSubstr("--journal"));
  EXPECT_EQ(commander.added(), 4096U);
  commander.forget_added();
  add_many(4095);
  commander.pulse();
  manual.run(8);
  const auto entries = news();
  ASSERT_FALSE(entries.empty());
  EXPECT_EQ(entries[0].kind, JournalKind::taken);
  EXPECT_EQ(entries[0].records.size(), 4095U);
}

TEST_F(SmallJournalTest, AReaderThatWasOvertakenIsToldHowMuchItMissedAndGoesOn) {
  send(commander, 0, -1.0);
  manual.run(1);
  ASSERT_FALSE(news().empty());
  for (int i = 0; i < 10'000; ++i) {
    send(commander, 0, i);
    manual.run(1);
  }
  const auto entries = news();
  ASSERT_GT(entries.size(), 1000U);
  EXPECT_GT(entries[0].missed, 20'000U);
  for (std::size_t i = 1; i < entries.size(); ++i) ASSERT_EQ(entries[i].missed, 0U);
  for (std::size_t i = 3; i < entries.size(); ++i) ASSERT_FALSE(entries[i].records_lost);
}

// ------------------------------------------------------------------------------ deaths, bursts

TEST_F(JournalAuthorTest, ShowsTheDeathOfACommander) {
  StandingProcess child([](const StandingProcess::Stand& stand) {
    UntypedFrontend frontend("pair");
    send(frontend, 0, 5.0, {.pace = iterations(1'000'000'000)});
    stand();
  });
  manual.run(1);
  const auto before = news();
  ASSERT_FALSE(before.empty());
  child.kill_now();
  std::vector<JournalEntry> entries;
  manual.run_until([&] {
    for (const JournalEntry& entry : news()) entries.push_back(entry);
    return !entries.empty();
  });
  EXPECT_EQ(entries[0].kind, JournalKind::died);
  EXPECT_EQ(entries[0].lane, before[0].lane);
  EXPECT_EQ(entries[0].owner, before[0].owner);
  EXPECT_EQ(entries[0].who, before[0].who);
}

TEST_F(JournalTraces, ShowsTheSilenceOfACommander) {
  play({.segment = "pair", .stale = Stale::purge, .silence = 5},
       "a = 0 to 5 over 1000; run 20; journal taken@1 active@1 silent@7 purged@7");
}

TEST_F(JournalTraces, ShowsBursts) {
  play_bursts("0 to 1; burst 4; journal burst@1 taken@1 completed@1 burst_ended@4");
}

TEST_F(JournalTraces, ACommandThatEndsInItsFirstIterationHasOneEntry) {
  play(R"(0 to 0.5; 1 to 0.25; 1 to 0.75 over 2; a = pulse; run 4
    journal taken@1 completed@1 completed@1 active@2 completed@3)");
}

/// The lane of the commander, when a reader comes after the ring was filled since its last batch.
class LateReaderTest : public JournalAuthorTest {
 protected:
  LateReaderTest() : JournalAuthorTest({.segment = "pair", .journal = 1 << 19}) {}
  /// Another frontend's batches until the ring has none of the entries before.
  void flood() {
    UntypedFrontend other("pair");
    for (int i = 0; i < 2000; ++i) {
      for (int k = 0; k < 8; ++k) add(other, 1, 0.5);
      other.pulse();
      manual.run(1);
    }
  }
  std::vector<JournalEntry> of_late_reader(JournalKind kind) {
    Journal late(observer);
    std::vector<JournalEntry> found;
    for (const JournalEntry& entry : all_of(late))
      if (entry.kind == kind) found.push_back(entry);
    return found;
  }
};

TEST_F(LateReaderTest, FindsTheNameOfAHolderThatLostControl) {
  commander.add_take_control();
  commander.pulse();
  manual.run(1);
  flood();
  EXPECT_THAT(of_late_reader(JournalKind::control_taken), ::testing::IsEmpty());
  // in a lane of its own: the next owner of the holder's lane would take the place of its name
  UntypedFrontend other("pair");
  send(other, 0, 1.0);
  manual.run(1);
  commander.close();
  // the next batch finds that the holder has gone
  send(other, 0, 2.0);
  manual.run(1);
  const auto lost = of_late_reader(JournalKind::control_lost);
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_EQ(lost[0].owner, 1U);
  EXPECT_THAT(lost[0].who, HasSubstr(this_process()));
}

TEST_F(LateReaderTest, FindsTheNamesOfAllBatchesInTheRing) {
  send(commander, 0, 5.0);
  manual.run(1);
  flood();
  const auto taken = of_late_reader(JournalKind::taken);
  ASSERT_FALSE(taken.empty());
  for (const JournalEntry& entry : taken) ASSERT_THAT(entry.who, HasSubstr(this_process()));
}

}  // namespace
}  // namespace o80::test
