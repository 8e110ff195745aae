// The format of journals in files: what was encoded is decoded, what is unknown is skipped, what is
// damaged is refused. tests/data/recordings has files of each version.

#include "runtime/journal/journal_codec.hpp"
#include "runtime/journal/journal_encoder.hpp"
#include "runtime/journal/journal_format.hpp"

#include <algorithm>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <utility>

#include "o80/base/error.hpp"
#include "runtime/journal/recorded_journal.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using ::testing::ThrowsMessage;

template <class Struct>
void append(std::vector<std::byte>& to, const Struct& value) {
  const auto bytes = std::as_bytes(std::span(&value, 1));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// Entries as backends write them, drawn from a seed.
class Draw {
 public:
  explicit Draw(std::uint32_t seed) : random_(seed) {}
  std::uint64_t number() { return random_(); }
  std::uint64_t below(std::uint64_t most) { return random_() % most; }
  template <std::size_t size>
  void fill(std::array<char, size>& text) {
    text = {};
    for (std::size_t i = below(size); i > 0; --i) text[i - 1] = static_cast<char>(1 + below(255));
  }

  /// A record of any kind that a frontend may send, also with values that no o80 knows.
  void add_record(std::vector<std::byte>& blocks) {
    RecordHead head;
    head.kind = static_cast<RecordKind>(2 + below(9));
    head.mode = static_cast<Mode>(below(3));
    head.pace = static_cast<Pace>(below(8));
    head.profile = static_cast<Profile>(below(4));
    head.start = static_cast<Start>(below(3));
    head.masked = static_cast<std::uint8_t>(below(2));
    head.actuator = static_cast<std::uint16_t>(number());
    head.id = number();
    head.rows = static_cast<std::uint32_t>(number());
    head.amount = static_cast<std::int64_t>(number());
    head.payload_bytes = static_cast<std::uint32_t>(below(4) == 0 ? below(2000) : below(40));
    append(blocks, head);
    std::string payload;
    while (payload.size() < head.payload_bytes) payload += static_cast<char>(number());
    const auto bytes = std::as_bytes(std::span(payload));
    blocks.insert(blocks.end(), bytes.begin(), bytes.end());
    if (head.kind == RecordKind::mark && !payload.empty() && payload.size() <= kMaxMarkBytes)
      marks.push_back(payload);
    blocks.resize((blocks.size() + kBlockBytes - 1) / kBlockBytes * kBlockBytes);
  }
  std::vector<std::byte> batch(CommandId id) {
    std::vector<std::byte> blocks(kBlockBytes);
    const std::uint64_t records = below(6);
    for (std::uint64_t i = 0; i < records; ++i) add_record(blocks);
    BatchRecord batch;
    batch.late_now = static_cast<std::uint8_t>(below(2));
    batch.flags = static_cast<std::uint16_t>(below(4));
    batch.records = static_cast<std::uint32_t>(records);
    batch.id = id;
    batch.ticket = number();
    batch.at = static_cast<Iteration>(number());
    batch.burst = static_cast<std::int64_t>(below(100));
    batch.blocks = static_cast<std::uint32_t>(blocks.size() / kBlockBytes);
    std::memcpy(blocks.data(), &batch, sizeof batch);
    return blocks;
  }

  /// An entry that is not of blocks.
  JournalItem plain(JournalKind kind) {
    JournalItem item;
    item.head = {.kind = kind, .lane = static_cast<std::uint8_t>(number())};
    item.head.what = static_cast<std::uint32_t>(number());
    item.head.iteration = static_cast<Iteration>(number());
    item.head.id = number();
    const auto signed_number = [&] { return static_cast<std::int64_t>(number()); };
    switch (kind) {
      case JournalKind::owner: {
        std::array<char, sizeof(JournalOwner)> name;
        fill(name);
        append(item.payload, name);
        break;
      }
      case JournalKind::taken:
      case JournalKind::scheduled:
      case JournalKind::rejected:
        append(item.payload, JournalBatch{number(), number(), signed_number()});
        break;
      case JournalKind::halt:
      case JournalKind::halt_reason: {
        JournalHalt halt{.cause = below(256)};
        fill(halt.who);
        fill(halt.text);
        append(item.payload, halt);
        break;
      }
      case JournalKind::resume:
      case JournalKind::burst_ended:
        append(item.payload, JournalSender{number()});
        break;
      case JournalKind::burst:
        append(item.payload, JournalBurst{signed_number(), number()});
        break;
      case JournalKind::ended: {
        JournalText text;
        fill(text);
        append(item.payload, text);
        break;
      }
      case JournalKind::statuses:
        item.head.what = static_cast<std::uint32_t>(1 + below(kMaxStatuses));
        for (std::uint64_t i = 1 + below(5); i > 0; --i)
          append(item.payload, JournalStatusRun{number(), below(9), number()});
        break;
      case JournalKind::snapshot:
        for (std::uint64_t i = below(9); i > 0; --i) append(item.payload, number());
        break;
      default:
        break;
    }
    return item;
  }

  /// All kinds of entries in any order, with batches of two lanes whose blocks come in pieces; a
  /// few more than `count`, so that each batch is whole.
  std::vector<JournalItem> journal(std::size_t count) {
    std::vector<JournalItem> items;
    std::array<std::vector<std::byte>, 2> left;
    std::array<std::uint32_t, 2> read{};
    std::array<CommandId, 2> ids{};
    while (items.size() < count || !left[0].empty() || !left[1].empty()) {
      const auto kind = static_cast<JournalKind>(below(kJournalKinds));
      if (kind != JournalKind::records) {
        items.push_back(plain(kind));
        continue;
      }
      const std::size_t lane = below(2);
      if (left[lane].empty()) {
        if (items.size() >= count) continue;
        ids[lane] = number();
        left[lane] = batch(ids[lane]);
        read[lane] = 0;
      }
      JournalItem item;
      item.head = {.kind = kind, .lane = static_cast<std::uint8_t>(lane), .what = read[lane]};
      item.head.id = ids[lane];
      const std::size_t blocks = 1 + below(left[lane].size() / kBlockBytes);
      const auto end = left[lane].begin() + static_cast<std::ptrdiff_t>(blocks * kBlockBytes);
      item.payload.assign(left[lane].begin(), end);
      left[lane].erase(left[lane].begin(), end);
      read[lane] += static_cast<std::uint32_t>(blocks);
      items.push_back(item);
    }
    std::uint64_t next = 0;
    for (JournalItem& item : items) {
      item.head.words = static_cast<std::uint16_t>((sizeof item.head + item.payload.size()) / 8);
      item.head.number = next;
      next += item.head.numbers();
    }
    return items;
  }

  std::vector<std::string> marks;  // texts, of the records so far

 private:
  std::mt19937_64 random_;
};

std::vector<std::byte> encoded(const std::vector<JournalItem>& items) {
  JournalEncoder encoder;
  std::vector<std::byte> bytes;
  for (const JournalItem& item : items) encoder.encode(item.head, item.payload, bytes);
  return bytes;
}

std::vector<JournalItem> decoded(std::span<const std::byte> bytes,
                                 std::int64_t version = kJournalCodec) {
  std::vector<JournalItem> items;
  decode_journal(version, bytes, [&](JournalItem& item) { items.push_back(item); });
  return items;
}

std::vector<std::byte> memory_of(const std::vector<JournalItem>& items) {
  std::vector<std::byte> bytes;
  for (const JournalItem& item : items) {
    append(bytes, item.head);
    bytes.insert(bytes.end(), item.payload.begin(), item.payload.end());
  }
  return bytes;
}

TEST(JournalCodecTest, DecodesWhateverWasEncoded) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    const std::vector<JournalItem> items = Draw(seed).journal(100);
    const std::vector<JournalItem> found = decoded(encoded(items));
    ASSERT_EQ(found.size(), items.size()) << seed;
    for (std::size_t i = 0; i < items.size(); ++i)
      ASSERT_EQ(memory_of({found[i]}), memory_of({items[i]}))
          << seed << ": entry " << i << ", " << to_text(items[i].head.kind);
  }
}

TEST(JournalCodecTest, FindsTheTextsOfMarksHoweverTheirBlocksAreRead) {
  std::size_t marks = 0;
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    Draw draw(seed);
    JournalEncoder encoder;
    std::vector<std::byte> bytes;
    std::vector<std::string> found;
    for (const JournalItem& item : draw.journal(100)) {
      encoder.encode(item.head, item.payload, bytes);
      for (JournalEncoder::Mark& mark : encoder.take_marks()) {
        EXPECT_EQ(mark.iteration, item.head.iteration);
        found.push_back(std::move(mark.text));
      }
    }
    ASSERT_THAT(found, ::testing::UnorderedElementsAreArray(draw.marks)) << seed;
    marks += found.size();
  }
  EXPECT_GT(marks, 50U);
}

TEST(JournalCodecTest, ACutEntryIsRefused) {
  const std::vector<JournalItem> items = Draw(1).journal(12);
  const std::vector<std::byte> bytes = encoded(items);
  std::vector<std::size_t> ends = {0};
  for (std::size_t i = 1; i <= items.size(); ++i)
    ends.push_back(encoded({items.begin(), items.begin() + static_cast<std::ptrdiff_t>(i)}).size());
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    const auto whole = std::ranges::find(ends, cut);
    if (whole != ends.end()) {
      EXPECT_EQ(decoded(std::span(bytes).first(cut)).size(),
                static_cast<std::size_t>(whole - ends.begin()));
    } else {
      EXPECT_THROW(decoded(std::span(bytes).first(cut)), InvalidArgument) << cut;
    }
  }
}

TEST(JournalCodecTest, ANewerVersionIsRefused) {
  EXPECT_THAT(
      [] { decoded({}, kJournalCodec + 1); },
      ThrowsMessage<InvalidArgument>(AllOf(
          HasSubstr("version " + std::to_string(kJournalCodec + 1) + " of the format"),
          HasSubstr("reads version " + std::to_string(kJournalCodec)), HasSubstr("newer o80"))));
  for (const std::int64_t none : {-1, 0})
    EXPECT_THAT([none] { decoded({}, none); },
                ThrowsMessage<InvalidArgument>(HasSubstr("the journal is damaged")));
}

TEST(JournalCodecTest, ABatchWhoseBlocksWereMissedIsDropped) {
  Draw draw(4);
  std::vector<std::byte> blocks = draw.batch(7);
  while (blocks.size() < 3 * kBlockBytes) blocks = draw.batch(7);
  JournalItem later;
  later.head = {.kind = JournalKind::records, .what = 1, .id = 7};
  later.payload.assign(blocks.begin() + kBlockBytes, blocks.end());
  const std::vector<JournalItem> found = decoded(encoded({later}));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].head.kind, JournalKind::dropped);
  EXPECT_EQ(found[0].head.id, 7U);
}

// ------------------------------------------------------------------------------ unknown kinds

/// A batch of one lane in a file of a later o80, and the decision on it.
class LaterFileTest : public ManualBackendTest {
 protected:
  void SetUp() override {
    ManualBackendTest::SetUp();
    StartedBackend manual;
    description_ = UntypedFrontend("pair").description();
  }
  void begin_batch(std::uint32_t records, std::uint32_t blocks) {
    records_.clear();
    file_.clear();
    numbers_ = 0;
    BatchRecord batch;
    batch.records = records;
    batch.blocks = blocks;
    LittleEndianWriter put(records_);
    put.u16(1U, journal_format::kBatchFields);
    put.u32(0U, 0U);
    journal_format::batch_fields(put, batch);
  }
  void add_record(std::uint16_t kind, const RecordHead& head, std::span<const std::byte> payload) {
    LittleEndianWriter put(records_);
    put.u16(kind, journal_format::kRecordFields);
    put.u32(payload.size(), payload.size());
    journal_format::record_fields(put, head);
    put.bytes(payload);
  }
  void add_command(Profile profile = Profile::linear) {
    RecordHead head;
    head.profile = profile;
    add_record(2U, head, std::vector<std::byte>(8));
  }
  void add_seen(std::int64_t iteration, std::int64_t since, std::uint16_t clock = 0,
                std::size_t payload = 16) {
    RecordHead head;
    head.amount = iteration;
    head.id = static_cast<CommandId>(since);
    head.actuator = clock;
    add_record(journal_format::kSeen, head, std::vector<std::byte>(payload, std::byte{1}));
  }
  /// What the reader makes of one behind a command, in the decision of iteration 0.
  std::optional<Seen> seen_behind_a_command(const std::function<void()>& add) {
    begin_batch(1, 3);
    add_command();
    add();
    const std::vector<JournalEntry> found = entries();
    EXPECT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].records.size(), 1U);
    EXPECT_EQ(found[0].unknown, "");
    return found[0].seen;
  }
  void add_unknown(std::uint16_t kind, std::size_t fields, std::size_t payload) {
    LittleEndianWriter put(records_);
    put.u16(kind, fields);
    put.u32(payload, payload);
    put.bytes(std::vector<std::byte>(fields + payload, std::byte{0x5A}));
  }
  void add_entry(std::uint8_t kind, std::span<const std::byte> payload) {
    JournalHead head;
    head.kind = static_cast<JournalKind>(kind);
    head.number = numbers_++;
    LittleEndianWriter put(file_);
    put.u32(34 + payload.size());
    journal_format::head_fields(put, head);
    put.bytes(payload);
  }
  std::vector<JournalEntry> entries() {
    if (!records_.empty()) add_entry(1, records_);
    add_entry(4, std::vector<std::byte>(24));
    std::vector<JournalEntry> entries;
    RecordedJournal(description_).decode(file_, entries);
    return entries;
  }

  std::shared_ptr<const Description> description_;
  std::vector<std::byte> records_;
  std::vector<std::byte> file_;
  std::uint64_t numbers_ = 0;
};

TEST_F(LaterFileTest, ARecordOfAnUnknownKindIsSkippedAndNamed) {
  using Kind = JournalRecord::Kind;
  for (const std::size_t fields : {0U, 5U, 27U, 300U}) {
    for (const std::size_t payload : {0U, 16U, 500U}) {
      begin_batch(3, 4);
      add_command();
      add_unknown(13, fields, payload);
      add_command();
      const std::vector<JournalEntry> found = entries();
      ASSERT_EQ(found.size(), 1U);
      std::vector<Kind> kinds;
      for (const JournalRecord& record : found[0].records) kinds.push_back(record.kind);
      EXPECT_THAT(kinds, ElementsAre(Kind::command, Kind::unknown, Kind::command));
      EXPECT_EQ(found[0].records[1].unknown, "record kind 13");
      EXPECT_EQ(found[0].unknown, "record kind 13");
      EXPECT_FALSE(found[0].records_lost);
    }
  }
}

TEST_F(LaterFileTest, WhatWasSeenIsReadAndWhatIsNoRowIsNot) {
  constexpr std::uint64_t kOnes = 0x0101010101010101;
  const Seen row{kOnes, 7, static_cast<std::int64_t>(kOnes), Clock::simulated, -1};
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, -1, 1); }), row);
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, 3, 1); }), row) << "a row of the future";
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, -9, 1); }), row);
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, kMaxIterations + 1, 1); }), row);
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(-1, -1); }), std::nullopt);
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(kMaxIterations + 1, -1); }), std::nullopt);
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, -1, 2); }), std::nullopt) << "no clock";
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, -1, 0, 15); }), std::nullopt);
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, -1, 0, 17); }), std::nullopt);
  EXPECT_EQ(seen_behind_a_command([&] { add_seen(7, -1, 0, 0); }), std::nullopt);
  EXPECT_EQ(seen_behind_a_command([&] { add_unknown(12, 27, 16); }), std::nullopt);
  EXPECT_EQ(seen_behind_a_command([&] {
              add_seen(7, -1);
              add_seen(8, -1);
            }),
            std::nullopt)
      << "two answers are none";
  EXPECT_EQ(seen_behind_a_command([] {}), std::nullopt);
}

TEST_F(LaterFileTest, ACommandWithAnUnknownWordIsNotReadAsAnother) {
  begin_batch(2, 3);
  add_command(static_cast<Profile>(99));
  add_command();
  const std::vector<JournalEntry> found = entries();
  ASSERT_EQ(found.size(), 1U);
  ASSERT_EQ(found[0].records.size(), 2U);
  EXPECT_EQ(found[0].records[0].kind, JournalRecord::Kind::unknown);
  EXPECT_EQ(found[0].unknown, "profile 99");
}

TEST_F(LaterFileTest, AnEntryOfAnUnknownKindIsListed) {
  add_entry(200, std::vector<std::byte>(13));
  const std::vector<JournalEntry> found = entries();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].kind, JournalKind::none);
  EXPECT_EQ(found[0].unknown, "entry kind 200");
  EXPECT_EQ(found[1].kind, JournalKind::taken);
}

TEST_F(LaterFileTest, AKnownKindWithOtherFieldsIsRefused) {
  begin_batch(1, 2);
  add_unknown(2, 28, 8);
  EXPECT_THROW(entries(), InvalidArgument);
}

}  // namespace
}  // namespace o80::test
