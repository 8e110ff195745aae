// A journal that is read raw, as a recorder reads it, and decoded later.

#include "runtime/journal/recorded_journal.hpp"

#include <random>
#include <tuple>

#include "runtime/frontend/raw_journal.hpp"
#include "runtime/journal/journal_author.hpp"
#include "runtime/journal/recorded_decisions.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

constexpr std::size_t kMuch = 1 << 24;

/// What an entry says, to compare two of them.
auto facts_of(const JournalEntry& entry) {
  return std::tuple(entry.kind, entry.number, entry.missed, entry.iteration, entry.lane,
                    entry.owner, entry.who, entry.id, entry.ticket, entry.at, entry.burst,
                    entry.records.size(), entry.records_lost, entry.blocks, entry.status,
                    entry.reason, entry.halt, entry.cause, entry.cut, entry.text, entry.actuator,
                    entry.state);
}

auto facts_of(const std::vector<JournalEntry>& entries) {
  std::vector<decltype(facts_of(entries.front()))> facts;
  facts.reserve(entries.size());
  for (const JournalEntry& entry : entries) facts.push_back(facts_of(entry));
  return facts;
}

class RecordedJournalTest : public ObservedBackendTest {
 protected:
  RecordedJournalTest() : ObservedBackendTest({.segment = "pair", .journal = 1 << 20}) {}
  /// Batches of one to three commands, some of them for later, a request, an interrupt and a halt.
  void play(int batches) {
    std::mt19937 random(7);
    for (int i = 0; i < batches; ++i) {
      for (unsigned left = random() % 3 + 1; left > 0; --left) {
        add(commander, random() % 2, 0.125 * (random() % 9), {.pace = iterations(3)});
      }
      if (i == batches / 2) add_request(commander, Reset{.seed = 5});
      PulseOptions options;
      if (i % 5 == 0) options.at = manual.last() + 4;
      commander.pulse(options);
      manual.run(2);
      if (i % 7 == 0) manual.backend.interrupt(1);
    }
    commander.halt("enough");
    manual.run(2);
  }
  std::vector<JournalEntry> all() const {
    Journal journal(observer);
    return all_of(journal);
  }
};

TEST_F(RecordedJournalTest, PartsOfAnySizeGiveTheSameEntriesAsTheRing) {
  play(40);
  const std::vector<JournalEntry> there = all();
  EXPECT_GT(there.size(), 100U);
  for (const std::size_t most : {std::size_t{1}, std::size_t{100}, std::size_t{3000}, kMuch}) {
    RawJournal raw(observer, 0);
    RecordedJournal journal(observer.description());
    std::vector<JournalEntry> entries;
    std::uint64_t next = 0;
    for (RawJournal::Entries part; (part = raw.read(most)).next != part.first;) {
      EXPECT_EQ(part.first, next);
      next = part.next;
      journal.decode(part.bytes, entries);
    }
    EXPECT_EQ(facts_of(entries), facts_of(there)) << most;
  }
}

TEST_F(RecordedJournalTest, ASuccessorGoesOnWithinALargeBatch) {
  for (int i = 0; i < 3000; ++i) add(commander, 0, 0.001 * i);
  commander.pulse();
  manual.run(30);
  RawJournal raw(observer, 0);
  std::vector<RawJournal::Entries> parts;
  for (RawJournal::Entries part; (part = raw.read(1)).next != part.first;) parts.push_back(part);
  const std::vector<JournalEntry> there = all();
  ASSERT_FALSE(there.empty());
  ASSERT_EQ(there.front().records.size(), 3000U);
  ASSERT_GT(parts.size(), 4U) << "its blocks are several entries";
  for (std::size_t i = 1; i < 4; ++i) {
    RecordedJournal journal(observer.description());
    std::vector<JournalEntry> entries;
    for (std::size_t k = 0; k < i; ++k) journal.decode(parts[k].bytes, entries);
    journal.decode(RawJournal(observer, parts[i].first).read(kMuch).bytes, entries);
    EXPECT_EQ(facts_of(entries), facts_of(there)) << i;
  }
}

/// In the row before an end in order nobody polls any more for a halt of its driver.
TEST(RecordedDecisions, AHaltBeforeAnEndInOrderNeedsNoEntry) {
  for (const bool stops : {false, true}) {
    RecordedDecisions recorded;
    JournalEntry stopping;
    stopping.kind = JournalKind::stopping;
    stopping.iteration = 7;
    if (stops) recorded.add(stopping, Schema(), 1);
    recorded.ask_to_halt(HaltCause::driver, "too high");
    if (stops) recorded.take();
    recorded.end_decisions(7);
    EXPECT_EQ(recorded.mismatch().has_value(), !stops);
  }
}

}  // namespace
}  // namespace o80::test
