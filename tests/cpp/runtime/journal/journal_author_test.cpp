// What the journal says of each kind of decision, read as a frontend reads it.

#include <gmock/gmock.h>

#include "memory/child_process.hpp"
#include "o80/base/error.hpp"
#include "o80/runtime/journal.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

std::vector<JournalEntry> all_of(Journal& journal) {
  std::vector<JournalEntry> entries;
  for (JournalEntry entry; journal.next(entry);) entries.push_back(entry);
  return entries;
}

std::vector<JournalKind> kinds_of(const std::vector<JournalEntry>& entries) {
  std::vector<JournalKind> kinds;
  for (const JournalEntry& entry : entries) kinds.push_back(entry.kind);
  return kinds;
}

std::string this_process() { return "pid " + std::to_string(getpid()); }

/// A backend, a commander, and a reader of the journal that may only observe.
class JournalAuthorTest : public StationTest {
 protected:
  explicit JournalAuthorTest(const BackendOptions& options = {.segment = "pair"})
      : station(options) {
    station.start();
    commander.emplace("pair");
    observer.emplace("pair", FrontendOptions{.access = Access::read_only});
    journal.emplace(*observer);
  }
  std::vector<JournalEntry> news() { return all_of(*journal); }

  Station station;
  std::optional<UntypedFrontend> commander;
  std::optional<UntypedFrontend> observer;
  std::optional<Journal> journal;
};

TEST_F(JournalAuthorTest, AnIterationWithoutCommandsWritesNothing) {
  station.run(10);
  EXPECT_TRUE(journal->exists());
  EXPECT_TRUE(news().empty());
}

TEST_F(JournalAuthorTest, HoldsTheStateThatASnapshotKeeps) {
  for (std::size_t size = 0; size <= 20; ++size) {
    station.kept.clear();
    for (std::size_t i = 0; i < size; ++i) station.kept.push_back(static_cast<std::byte>(i + 1));
    station.kept_slot = static_cast<std::uint32_t>(size);
    add_request<Snapshot>(*commander);
    commander->pulse();
    station.run(1);
    const std::vector<JournalEntry> entries = news();
    if (size == 0) {
      EXPECT_THAT(kinds_of(entries), ElementsAre(JournalKind::taken, JournalKind::status));
      continue;
    }
    ASSERT_THAT(kinds_of(entries),
                ElementsAre(JournalKind::taken, JournalKind::snapshot, JournalKind::status));
    EXPECT_EQ(entries[1].kept, station.kept);
    EXPECT_EQ(entries[1].slot, size);
    EXPECT_EQ(entries[1].iteration, entries[0].iteration);
  }
}

TEST_F(JournalAuthorTest, LeavesOutAStateThatIsLargerThanAnEntry) {
  station.kept.resize(std::size_t{1} << 20);
  add_request<Snapshot>(*commander);
  commander->pulse();
  station.run(1);
  EXPECT_THAT(kinds_of(news()), ElementsAre(JournalKind::taken, JournalKind::status));
}

TEST_F(JournalAuthorTest, ShowsWhoSentWhatAndWhenItWasTakenStartedAndEnded) {
  station.run(2);
  add(*commander, 1, 0.5, {.pace = iterations(3), .profile = Profile::linear});
  const Batch batch = commander->pulse();
  station.run(5);
  const std::vector<JournalEntry> entries = news();
  ASSERT_THAT(kinds_of(entries),
              ElementsAre(JournalKind::taken, JournalKind::status, JournalKind::status));

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

  EXPECT_EQ(entries[1].id, command.id);
  EXPECT_EQ(entries[1].status, Status::active);
  EXPECT_EQ(entries[1].iteration, 3);
  EXPECT_EQ(entries[2].id, command.id);
  EXPECT_EQ(entries[2].status, Status::completed);
  EXPECT_EQ(entries[2].iteration, 5);
  EXPECT_EQ(batch.handle(0).iteration, 5);
}

TEST_F(JournalAuthorTest, WhatABatchAnswersStandsInEachDecisionOnIt) {
  station.run(2);
  const UntypedObservation row = commander->latest();
  const auto pulse = [&](PulseOptions options) {
    options.seen = row;
    add(*commander, 0, 0.5);
    return commander->pulse(options);
  };
  pulse({});
  pulse({.at = 5});
  pulse({.at = 1});  // late
  station.run(4);
  std::vector<std::pair<JournalKind, Iteration>> decided;
  for (const JournalEntry& entry : news()) {
    if (entry.kind == JournalKind::status) continue;
    EXPECT_EQ(entry.records.size(), 1U);
    EXPECT_EQ(entry.seen, (Seen{commander->epoch(), 2, row.time(), row.schema().head.clock, 2}));
    decided.emplace_back(entry.kind, entry.iteration);
  }
  using enum JournalKind;
  EXPECT_THAT(decided, UnorderedElementsAre(std::pair(taken, 3), std::pair(scheduled, 3),
                                            std::pair(rejected, 3), std::pair(taken, 5)));
}

TEST_F(JournalAuthorTest, BatchesOfSeveralLanesStandInTheOrderOfTheirTickets) {
  UntypedFrontend second("pair");
  for (int i = 0; i < 5; ++i) {
    send(second, 0, i);
    send(*commander, 1, i);
  }
  station.run(1);
  std::vector<std::uint64_t> tickets;
  std::vector<std::uint32_t> lanes;
  for (const JournalEntry& entry : news()) {
    if (entry.kind != JournalKind::taken) continue;
    tickets.push_back(entry.ticket);
    lanes.push_back(entry.lane);
  }
  EXPECT_EQ(tickets.size(), 10U);
  EXPECT_TRUE(std::ranges::is_sorted(tickets));
  EXPECT_THAT(lanes, ElementsAre(0, 1, 0, 1, 0, 1, 0, 1, 0, 1));
}

TEST_F(JournalAuthorTest, ARejectedBatchComesWithItsRecordsAndTheReason) {
  commander->halt("enough");
  station.run(1);
  send(*commander, 0, 5.0);
  station.run(1);
  const auto entries = news();
  ASSERT_THAT(kinds_of(entries), ElementsAre(JournalKind::halt, JournalKind::rejected));
  EXPECT_EQ(entries[0].halt, 1U);
  EXPECT_EQ(entries[0].cause, HaltCause::frontend);
  EXPECT_EQ(entries[0].iteration, 1);
  EXPECT_EQ(entries[0].text, "enough");
  EXPECT_THAT(entries[0].who, HasSubstr(this_process()));
  EXPECT_EQ(entries[1].reason, Reason::halted);
  EXPECT_EQ(entries[1].iteration, 2);
  ASSERT_EQ(entries[1].records.size(), 1U);
  EXPECT_EQ(unpack<double>(entries[1].records[0].targets[0].states.data()), 5.0);
}

TEST_F(JournalAuthorTest, ShowsAHaltAndItsResume) {
  send(*commander, 0, 5.0, {.pace = iterations(10)});
  station.run(2);
  const std::uint64_t number = commander->halt("stop");
  station.run(2);
  UntypedFrontend other("pair");
  std::thread helper([&] { other.resume(number, kPatience); });
  station.run_until([&] { return !commander->halted(); });
  helper.join();
  const auto entries = news();
  ASSERT_THAT(kinds_of(entries),
              ElementsAre(JournalKind::taken, JournalKind::status, JournalKind::halt,
                          JournalKind::status, JournalKind::taken, JournalKind::resume,
                          JournalKind::fresh_start, JournalKind::status));
  EXPECT_EQ(entries[5].owner, 1U);
  EXPECT_THAT(entries[5].who, HasSubstr(this_process()));
}

TEST_F(JournalAuthorTest, ABatchForLaterIsScheduledAndThenTaken) {
  add(*commander, 0, 1.0);
  commander->pulse({.at = 6});
  station.run(8);
  const auto entries = news();
  ASSERT_THAT(kinds_of(entries),
              ElementsAre(JournalKind::scheduled, JournalKind::taken, JournalKind::status));
  EXPECT_EQ(entries[0].iteration, 1);
  EXPECT_EQ(entries[0].at, 6);
  EXPECT_EQ(entries[0].records.size(), 1U);
  EXPECT_EQ(entries[1].iteration, 6);
  EXPECT_EQ(entries[1].records.size(), 1U);
}

TEST_F(JournalAuthorTest, ShowsWhoTookAndReleasedControl) {
  commander->add_take_control();
  commander->pulse();
  station.run(1);
  UntypedFrontend other("pair");
  send(other, 0, 1.0);
  station.run(1);
  commander->add_release_control();
  commander->pulse();
  station.run(1);
  std::vector<JournalEntry> entries = news();
  std::erase_if(entries, [](const JournalEntry& entry) {
    return entry.kind == JournalKind::taken || entry.kind == JournalKind::status;
  });
  ASSERT_THAT(kinds_of(entries), ElementsAre(JournalKind::control_taken, JournalKind::rejected,
                                             JournalKind::control_released));
  EXPECT_THAT(entries[0].who, HasSubstr(this_process()));
  EXPECT_EQ(entries[1].reason, Reason::exclusive);
  EXPECT_EQ(entries[1].detail, entries[0].lane);
}

TEST_F(JournalAuthorTest, ControlIsLostWhenItsHolderCloses) {
  commander->add_take_control();
  commander->pulse();
  station.run(1);
  commander->close();
  UntypedFrontend other("pair");
  send(other, 0, 1.0);
  station.run(1);
  const auto kinds = kinds_of(news());
  EXPECT_THAT(kinds, ::testing::Contains(JournalKind::control_lost));
}

TEST_F(JournalAuthorTest, ShowsAnInterruptByTheDriver) {
  send(*commander, 1, 5.0, {.pace = iterations(10)});
  station.run(2);
  station.backend.interrupt(1);
  station.run(1);
  const auto entries = news();
  ASSERT_THAT(kinds_of(entries), ElementsAre(JournalKind::taken, JournalKind::status,
                                             JournalKind::interrupted, JournalKind::status));
  EXPECT_EQ(entries[2].actuator, 1U);
  EXPECT_EQ(entries[2].iteration, 3);
  EXPECT_EQ(entries[3].status, Status::interrupted);
}

TEST_F(JournalAuthorTest, ShowsRequestsWithTheirStructAndFreshStarts) {
  add_request(*commander, Reset{.seed = 7});
  add_request(*commander, Refuse{});
  commander->pulse();
  station.run(1);
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

TEST_F(JournalAuthorTest, TheEndOfTheBackendIsItsLastEntry) {
  send(*commander, 0, 5.0, {.pace = iterations(10)});
  station.run(2);
  station.backend.end(BackendState::failed, "the arm fell off");
  const auto entries = news();
  ASSERT_FALSE(entries.empty());
  EXPECT_EQ(entries.back().kind, JournalKind::ended);
  EXPECT_EQ(entries.back().state, BackendState::failed);
  EXPECT_EQ(entries.back().text, "the arm fell off");
  EXPECT_EQ(entries[entries.size() - 2].status, Status::purged);
}

TEST_F(JournalAuthorTest, ReadsOnFromANumberWithoutLosingRecords) {
  add(*commander, 0, 1.0);
  commander->pulse({.at = 4});
  station.run(1);
  const auto before = news();
  ASSERT_EQ(before.size(), 1U);
  station.run(5);
  Journal other(*observer);
  other.seek(before.back().number + 1);
  const auto after = all_of(other);
  ASSERT_FALSE(after.empty());
  EXPECT_EQ(after[0].kind, JournalKind::taken);
  EXPECT_EQ(after[0].records.size(), 1U);
  EXPECT_EQ(after[0].missed, 0U);
  other.seek_end();
  EXPECT_TRUE(all_of(other).empty());
}

TEST_F(JournalAuthorTest, OfManyRejectedCommandsTheBatchIsOneEntry) {
  commander->halt("enough");
  station.run(1);
  for (int i = 0; i < 500; ++i) add(*commander, 0, i);
  commander->pulse();
  station.run(10);
  EXPECT_EQ(news().size(), 2U);
}

// ------------------------------------------------------------------------------ size

class SmallJournalTest : public JournalAuthorTest {
 protected:
  SmallJournalTest() : JournalAuthorTest({.segment = "pair", .lane_blocks = 16384, .journal = 1}) {}
};

TEST_F(SmallJournalTest, ABatchLargerThanHalfOfItIsRefusedBeforeItIsSent) {
  const auto add_many = [&](int count) {
    for (int i = 0; i < count; ++i) add(*commander, 0, i);
  };
  add_many(4096);
  const std::string why = message_of<InvalidArgument>([&] { commander->pulse(); });
  EXPECT_THAT(why, HasSubstr("this batch takes 262208 bytes"));
  EXPECT_THAT(why, HasSubstr("the journal of 'pair' allows 262144"));
  EXPECT_THAT(why, HasSubstr("--journal"));
  EXPECT_EQ(commander->added(), 4096U);
  commander->forget_added();
  add_many(4095);
  commander->pulse();
  station.run(8);
  const auto entries = news();
  ASSERT_FALSE(entries.empty());
  EXPECT_EQ(entries[0].kind, JournalKind::taken);
  EXPECT_EQ(entries[0].records.size(), 4095U);
}

TEST_F(SmallJournalTest, AReaderThatWasOvertakenIsToldHowMuchItMissedAndGoesOn) {
  send(*commander, 0, -1.0);
  station.run(1);
  ASSERT_FALSE(news().empty());
  for (int i = 0; i < 10'000; ++i) {
    send(*commander, 0, i);
    station.run(1);
  }
  const auto entries = news();
  ASSERT_GT(entries.size(), 1000U);
  EXPECT_GT(entries[0].missed, 20'000U);
  for (std::size_t i = 1; i < entries.size(); ++i) ASSERT_EQ(entries[i].missed, 0U);
  for (std::size_t i = 3; i < entries.size(); ++i) {
    ASSERT_FALSE(entries[i].records_lost);
    if (entries[i].kind == JournalKind::taken && i > entries.size() / 2) {
      ASSERT_THAT(entries[i].who, HasSubstr(this_process())) << "the name is repeated";
    }
  }
}

TEST_F(StationTest, ABackendMayHaveNoJournal) {
  StartedStation station({.segment = "pair", .journal = 0});
  UntypedFrontend frontend("pair");
  for (int i = 0; i < 5000; ++i) add(frontend, 0, i);
  frontend.pulse();
  station.run(10);
  Journal journal(frontend);
  JournalEntry entry;
  EXPECT_FALSE(journal.exists());
  EXPECT_FALSE(journal.next(entry));
}

// ------------------------------------------------------------------------------ deaths, bursts

TEST_F(JournalAuthorTest, ShowsTheDeathOfACommander) {
  StandingProcess child([](const StandingProcess::Stand& stand) {
    UntypedFrontend frontend("pair");
    send(frontend, 0, 5.0, {.pace = iterations(1'000'000'000)});
    stand();
  });
  station.run(1);
  const auto before = news();
  ASSERT_FALSE(before.empty());
  child.kill_now();
  std::vector<JournalEntry> entries;
  station.run_until([&] {
    for (const JournalEntry& entry : news()) entries.push_back(entry);
    return !entries.empty();
  });
  EXPECT_EQ(entries[0].kind, JournalKind::died);
  EXPECT_EQ(entries[0].lane, before[0].lane);
  EXPECT_EQ(entries[0].owner, before[0].owner);
  EXPECT_EQ(entries[0].who, before[0].who);
}

class WatchedTest : public JournalAuthorTest {
 protected:
  WatchedTest() : JournalAuthorTest({.segment = "pair", .stale = Stale::purge, .silence = 5}) {}
};

TEST_F(WatchedTest, ShowsTheSilenceOfACommander) {
  send(*commander, 0, 5.0, {.pace = iterations(1000)});
  station.run(20);
  const auto entries = news();
  ASSERT_THAT(kinds_of(entries), ElementsAre(JournalKind::taken, JournalKind::status,
                                             JournalKind::silent, JournalKind::status));
  EXPECT_THAT(entries[2].who, HasSubstr(this_process()));
  EXPECT_EQ(entries[3].reason, Reason::silence);
  EXPECT_EQ(entries[3].iteration, entries[2].iteration);
}

TEST_F(StationTest, TheJournalShowsBursts) {
  StartedStation station({.segment = "pair", .bursting = true});
  UntypedFrontend frontend("pair");
  Journal journal(frontend);
  add(frontend, 0, 1.0);
  frontend.start_burst(4);
  station.drive();
  const auto entries = all_of(journal);
  ASSERT_THAT(kinds_of(entries), ElementsAre(JournalKind::burst, JournalKind::taken,
                                             JournalKind::status, JournalKind::burst_ended));
  EXPECT_EQ(entries[0].burst, 4);
  EXPECT_EQ(entries[1].burst, 4);
  EXPECT_EQ(entries[3].iteration, 4);
  EXPECT_FALSE(entries[3].cut);
  for (const std::size_t i : {0, 1, 3}) EXPECT_THAT(entries[i].who, HasSubstr(this_process()));
}

TEST_F(JournalAuthorTest, ACommandThatEndsInItsFirstIterationHasOneEntry) {
  add(*commander, 0, 0.5);
  add(*commander, 1, 0.25);
  add(*commander, 1, 0.75, {.pace = iterations(2), .profile = Profile::linear});
  commander->pulse();
  station.run(4);
  std::vector<std::tuple<CommandId, Status, Iteration>> found;
  std::vector<std::uint64_t> numbers;
  CommandId first = 0;
  for (const JournalEntry& entry : news()) {
    if (entry.kind == JournalKind::taken) first = entry.records[0].id;
    if (entry.kind != JournalKind::status) continue;
    found.emplace_back(entry.id - first, entry.status, entry.iteration);
    numbers.push_back(entry.number);
  }
  EXPECT_THAT(found,
              ElementsAre(std::tuple(0, Status::completed, 1), std::tuple(1, Status::completed, 1),
                          std::tuple(2, Status::active, 2), std::tuple(2, Status::completed, 3)));
  EXPECT_EQ(numbers[1], numbers[0] + 1);
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
      station.run(1);
    }
  }
  std::vector<JournalEntry> of_late_reader(JournalKind kind) {
    Journal late(*observer);
    std::vector<JournalEntry> found;
    for (const JournalEntry& entry : all_of(late))
      if (entry.kind == kind) found.push_back(entry);
    return found;
  }
};

TEST_F(LateReaderTest, FindsTheNameOfAHolderThatLostControl) {
  commander->add_take_control();
  commander->pulse();
  station.run(1);
  flood();
  EXPECT_THAT(of_late_reader(JournalKind::control_taken), ::testing::IsEmpty());
  // in a lane of its own: the next owner of the holder's lane would take the place of its name
  UntypedFrontend other("pair");
  send(other, 0, 1.0);
  station.run(1);
  commander->close();
  // the next batch finds that the holder has gone
  send(other, 0, 2.0);
  station.run(1);
  const auto lost = of_late_reader(JournalKind::control_lost);
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_EQ(lost[0].owner, 1U);
  EXPECT_THAT(lost[0].who, HasSubstr(this_process()));
}

TEST_F(LateReaderTest, FindsTheNamesOfAllBatchesInTheRing) {
  send(*commander, 0, 5.0);
  station.run(1);
  flood();
  const auto taken = of_late_reader(JournalKind::taken);
  ASSERT_FALSE(taken.empty());
  for (const JournalEntry& entry : taken) ASSERT_THAT(entry.who, HasSubstr(this_process()));
}

}  // namespace
}  // namespace o80::test
