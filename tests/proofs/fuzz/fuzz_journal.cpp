// A journal with damaged counters, marks and entries: a reader ends, stays inside the ring, and
// decodes what it gets; also from a damaged recording.

#include <cstdlib>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "fuzz/bytes.hpp"
#include "fuzz/robot.hpp"
#include "memory/ring/journal.hpp"
#include "o80/base/error.hpp"
#include "o80/runtime/journal.hpp"
#include "runtime/journal/journal_author.hpp"
#include "runtime/journal/journal_encoder.hpp"
#include "runtime/journal/journal_records.hpp"
#include "runtime/journal/recorded_journal.hpp"

namespace o80::fuzz {
namespace {

constexpr std::uint64_t kRing = kMinJournal;

/// A mapped segment file in private memory.
class File {
 public:
  File() {
    view.shape = {.page_bytes = 4096,
                  .schema_bytes = 0,
                  .provenance_bytes = 0,
                  .row_bytes = 8,
                  .slots = 2,
                  .lanes = 1,
                  .lane_blocks = 1,
                  .journal_bytes = kRing};
    if (!SegmentOffsets::compute(view.shape, view.offsets)) std::abort();
    memory_.reset(static_cast<std::byte*>(std::aligned_alloc(4096, view.offsets.file_bytes)));
    std::memset(memory_.get(), 0, view.offsets.file_bytes);
    view.base = memory_.get();
  }
  /// One 8-byte word of the journal's counters or of its ring.
  void set(std::uint32_t word, std::uint64_t value) {
    constexpr std::uint32_t kCounters = sizeof(JournalCounters) / 8;
    std::byte* counters = reinterpret_cast<std::byte*>(&view.counters().journal);
    std::byte* at = word < kCounters ? counters + 8 * word
                                     : view.journal() + 8 * ((word - kCounters) % (kRing / 8));
    std::memcpy(at, &value, 8);
  }

  SegmentView view;

 private:
  struct Free {
    void operator()(std::byte* memory) const { std::free(memory); }
  };
  std::unique_ptr<std::byte, Free> memory_;
};

void write_some(JournalWriter& writer, Bytes& bytes) {
  std::vector<std::uint64_t> payload(64);
  for (std::uint32_t left = bytes.below(200); left > 0; --left) {
    JournalHead head;
    head.kind = static_cast<JournalKind>(bytes.number<std::uint8_t>() % 32);
    head.what = bytes.number<std::uint8_t>();
    const std::uint32_t words = bytes.below(static_cast<std::uint32_t>(payload.size()));
    payload[words] = bytes.word();
    writer.write(head, payload.data(), words * 8UL);
  }
}

/// What a reader may get without an end: no more entries than the ring has heads. Adds them to
/// `copy` as a recorder does.
void read_all(JournalReader& reader, const Schema& schema, std::vector<std::byte>& copy) {
  JournalEncoder encoder;
  JournalItem item;
  std::uint64_t entries = 0;
  while (reader.next(item)) {
    if (++entries > kRing / sizeof(JournalHead)) std::abort();
    if (item.payload.size() + sizeof(JournalHead) != item.head.words * 8UL) std::abort();
    if (to_text(item.head.kind).empty()) std::abort();
    records_of(schema, item.payload);
    seen_in(item.payload);
    encoder.encode(item.head, item.payload, copy);
  }
}

/// What a damaged recording may give: no more entries than statuses fit into its bytes.
void decode(const std::shared_ptr<const Description>& description,
            std::span<const std::byte> recorded) {
  std::vector<JournalEntry> entries;
  try {
    RecordedJournal(description).decode(recorded, entries);
  } catch (const InvalidArgument&) {
  }
  // the shortest entry of statuses has one run
  if (entries.size() > recorded.size() * kMaxStatuses / 48) std::abort();
}

std::shared_ptr<const Description> description_of_robot() {
  auto description = std::make_shared<Description>();
  description->schema = schema_of_robot();
  description->layout = row_layout(description->schema);
  return description;
}

}  // namespace

void run(Bytes bytes) {
  static const std::shared_ptr<const Description> description = description_of_robot();
  const Schema& schema = description->schema;
  std::vector<std::byte> copy;
  File file;
  JournalWriter writer(file.view);
  write_some(writer, bytes);
  JournalReader before(file.view);
  for (std::uint32_t left = bytes.below(64); left > 0; --left) {
    const auto word = bytes.number<std::uint16_t>();
    file.set(word, bytes.word());
  }
  read_all(before, schema, copy);
  JournalReader after(file.view);
  read_all(after, schema, copy);
  after.seek_end();
  write_some(writer, bytes);
  read_all(before, schema, copy);
  read_all(after, schema, copy);
  // as a recording that was damaged
  decode(description, copy);
  for (std::uint32_t left = bytes.below(16); left > 0 && copy.size() >= 8; --left) {
    const std::size_t word = bytes.number<std::uint16_t>() % (copy.size() / 8);
    const std::uint64_t value = bytes.word();
    std::memcpy(copy.data() + 8 * word, &value, 8);
  }
  decode(description, copy);
  // and as the blocks of a batch
  const auto rest = bytes.rest();
  records_of(schema, rest);
  seen_in(rest);
  decode(description, rest);
}

}  // namespace o80::fuzz
