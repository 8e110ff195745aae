#include "memory/ring/journal.hpp"

#include <gmock/gmock.h>

#include <array>
#include <atomic>
#include <numeric>
#include <thread>

#include "memory/segments.hpp"

namespace o80 {
namespace {

constexpr std::uint64_t kRing = 4096;

SegmentSpec spec_with_journal(std::uint64_t bytes = kRing) {
  SegmentSpec spec = small_spec();
  spec.journal_bytes = bytes;
  return spec;
}

/// An entry whose bytes all follow from its number and its length.
void write_numbered(JournalWriter& writer, std::uint64_t number, std::size_t words) {
  std::vector<std::uint64_t> payload(words);
  std::iota(payload.begin(), payload.end(), number * 1000);
  JournalHead head;
  head.kind = JournalKind::records;
  head.iteration = static_cast<Iteration>(number);
  head.id = words;
  writer.write(head, payload.data(), words * 8);
}

/// What is wrong with an entry of write_numbered(), or "".
std::string flaw_of(const JournalItem& item) {
  const std::uint64_t number = item.head.number;
  if (item.head.iteration != static_cast<Iteration>(number)) return "iteration";
  if (item.payload.size() != item.head.id * 8) return "length";
  for (std::size_t i = 0; i < item.head.id; ++i) {
    std::uint64_t word;
    std::memcpy(&word, item.payload.data() + 8 * i, 8);
    if (word != number * 1000 + i) return "word " + std::to_string(i);
  }
  return {};
}

std::size_t words_of(std::uint64_t number) { return number * 7 % 23; }

class JournalTest : public SegmentTest {
 protected:
  void write(std::uint64_t from, std::uint64_t to) {
    for (std::uint64_t i = from; i < to; ++i) write_numbered(writer_, i, words_of(i));
  }

  OwnedSegment segment_ = running_segment(spec_with_journal());
  JournalWriter writer_{segment_.view()};
  AttachedSegment attached_ = attach("arm", Access::read_only);
  JournalReader reader_{attached_.view()};
  JournalItem item_;
};

TEST_F(JournalTest, IsEmptyBeforeItsFirstEntry) {
  EXPECT_TRUE(reader_.has_journal());
  EXPECT_FALSE(reader_.next(item_));
}

TEST_F(JournalTest, GivesEveryEntryOnceInItsOrderOverManyLaps) {
  std::uint64_t next = 0;
  for (std::uint64_t i = 0; i < 5000; i += 3) {
    write(i, i + 3);
    while (reader_.next(item_)) {
      ASSERT_EQ(item_.head.number, next);
      ASSERT_EQ(item_.missed, 0U);
      ASSERT_EQ(flaw_of(item_), "");
      ++next;
    }
    ASSERT_EQ(next, i + 3);
  }
}

// rule O13
TEST_F(JournalTest, NumbersTheGapOfAReaderThatWasOvertaken) {
  write(0, 1000);
  std::uint64_t read = 0;
  std::uint64_t next = 0;
  while (reader_.next(item_)) {
    EXPECT_EQ(item_.missed, item_.head.number - next) << next;
    EXPECT_EQ(flaw_of(item_), "");
    EXPECT_TRUE(read == 0 || item_.missed == 0);
    next = item_.head.number + 1;
    ++read;
  }
  EXPECT_EQ(next, 1000U);
  // mean length 32 + 11 * 8 bytes; an eighth stays for the writer, and a sector for its mark
  EXPECT_GT(read, kRing * 3 / 4 / 120);
}

TEST_F(JournalTest, AReaderThatBeginsLateIsToldHowManyItMissed) {
  write(0, 1000);
  JournalReader late(attached_.view());
  ASSERT_TRUE(late.next(item_));
  EXPECT_EQ(item_.missed, item_.head.number);
  EXPECT_GT(item_.missed, 900U);
}

TEST_F(JournalTest, BehindTheNewestEntryNothingCountsAsMissed) {
  write(0, 1000);
  reader_.seek_end();
  EXPECT_FALSE(reader_.next(item_));
  write(1000, 1001);
  ASSERT_TRUE(reader_.next(item_));
  EXPECT_EQ(item_.head.number, 1000U);
  EXPECT_EQ(item_.missed, 0U);
}

TEST_F(JournalTest, AnEntryMayComeInPieces) {
  std::array<std::uint64_t, 16> piece{};
  for (int lap = 0; lap < 100; ++lap) {
    writer_.begin(8 * sizeof piece);
    for (std::uint64_t i = 0; i < 3; ++i) {
      piece.fill(i + 1);
      writer_.add(reinterpret_cast<const std::byte*>(piece.data()), sizeof piece);
    }
    writer_.end({.kind = JournalKind::records});
    ASSERT_TRUE(reader_.next(item_));
    ASSERT_EQ(item_.payload.size(), 3 * sizeof piece);
    ASSERT_EQ(item_.payload.back(), std::byte{0});
    ASSERT_EQ(item_.payload[2 * sizeof piece], std::byte{3});
  }
  // begun, but without any piece: no entry
  writer_.begin(64);
  writer_.end({.kind = JournalKind::records});
  EXPECT_FALSE(reader_.next(item_));
}

TEST_F(JournalTest, APieceBeyondTheAnnouncedPayloadIsLeftOutAlsoAtTheEndOfTheRing) {
  const std::array<std::uint64_t, 8> piece{};
  const auto* bytes = reinterpret_cast<const std::byte*>(piece.data());
  for (int lap = 0; lap < 3 * 4096 / 96; ++lap) {
    writer_.begin(sizeof piece);
    for (int i = 0; i < 3; ++i) writer_.add(bytes, sizeof piece);
    writer_.end({.kind = JournalKind::records});
    ASSERT_EQ(writer_.position(), (lap + 1) * 96U);
    ASSERT_EQ(segment_.view().counters().journal.begun.load(), writer_.position());
    ASSERT_TRUE(reader_.next(item_));
    ASSERT_EQ(item_.payload.size(), sizeof piece);
  }
}

TEST_F(JournalTest, APayloadThatIsTooLargeIsLeftOut) {
  std::vector<std::uint64_t> large(kRing / 8);
  writer_.write({.kind = JournalKind::halt}, large.data(), kRing);
  write(1, 2);
  ASSERT_TRUE(reader_.next(item_));
  EXPECT_EQ(item_.head.kind, JournalKind::halt);
  EXPECT_TRUE(item_.payload.empty());
  ASSERT_TRUE(reader_.next(item_));
  EXPECT_EQ(flaw_of(item_), "");
}

TEST_F(JournalTest, IsReadUpToItsLastWholeEntryAfterTheWriterHasStoppedInTheMiddleOfOne) {
  write(0, 200);
  std::array<std::uint64_t, 64> piece{};
  piece.fill(~0ULL);
  writer_.begin(sizeof piece);
  writer_.add(reinterpret_cast<const std::byte*>(piece.data()), sizeof piece);
  JournalReader late(attached_.view());
  std::uint64_t last = 0;
  for (JournalReader* reader : {&reader_, &late}) {
    while (reader->next(item_)) {
      EXPECT_EQ(flaw_of(item_), "");
      last = item_.head.number;
    }
    EXPECT_EQ(last, 199U);
  }
}

TEST_F(JournalTest, ASegmentMayHaveNone) {
  OwnedSegment other = running_segment(small_spec("other"));
  JournalWriter writer(other.view());
  write_numbered(writer, 0, 3);
  JournalReader reader(attach("other", Access::read_only).view());
  EXPECT_FALSE(writer.is_on());
  EXPECT_FALSE(reader.has_journal());
  EXPECT_FALSE(reader.next(item_));
  reader.seek_end();
  EXPECT_FALSE(reader.next(item_));
}

TEST_F(JournalTest, ADamagedLengthEndsInAGapNotInALoop) {
  write(0, 20);
  // the length of the third entry
  auto* words = reinterpret_cast<std::uint64_t*>(segment_.view().journal());
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(reader_.next(item_));
  const std::size_t third = 4 + words_of(0) + 4 + words_of(1);
  for (const std::uint64_t length : {0ULL, 3ULL, 0xFFFFULL}) {
    JournalReader reader = reader_;
    std::atomic_ref(words[third]).store(length, std::memory_order_relaxed);
    EXPECT_FALSE(reader.next(item_)) << length;
    EXPECT_FALSE(reader.next(item_)) << length;
  }
  write(20, 21);
  // the damage is skipped, and what follows is numbered
  EXPECT_FALSE(reader_.next(item_));
  write(21, 22);
  ASSERT_TRUE(reader_.next(item_));
  EXPECT_EQ(item_.head.number, 21U);
  EXPECT_EQ(item_.missed, 19U);
}

TEST_F(JournalTest, PositionsOfADamagedFileThatAreNoMultipleOfAWordAreNotUsed) {
  write(0, 200);
  JournalCounters& counters = segment_.view().counters().journal;
  for (auto& mark : counters.marks) mark.store(mark.load() + 3);
  JournalReader late(attached_.view());
  EXPECT_FALSE(late.next(item_)) << "no mark can be used";
  counters.published.store(counters.published.load() + 4);
  EXPECT_FALSE(late.next(item_));
  late.seek_end();
  EXPECT_FALSE(late.next(item_));
}

TEST_F(JournalTest, ReadersInOtherThreadsSeeWholeEntriesOnly) {
  std::atomic<bool> done{false};
  std::atomic<std::uint64_t> read{0};
  const auto follow = [&] {
    JournalReader reader(attached_.view());
    JournalItem item;
    std::uint64_t next = 0;
    bool last_round = false;
    while (true) {
      while (reader.next(item)) {
        ASSERT_EQ(flaw_of(item), "");
        ASSERT_EQ(item.missed, item.head.number - next);
        next = item.head.number + 1;
        read.fetch_add(1, std::memory_order_relaxed);
      }
      if (last_round) break;
      last_round = done.load(std::memory_order_acquire);
    }
    EXPECT_EQ(next, 20'000U);
  };
  std::thread first(follow);
  std::thread second(follow);
  write(0, 20'000);
  done.store(true, std::memory_order_release);
  first.join();
  second.join();
  EXPECT_GT(read.load(), 0U);
}

}  // namespace
}  // namespace o80
