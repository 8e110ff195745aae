#include "runtime/journal/journal_codec.hpp"

#include <string>

#include "base/little_endian.hpp"
#include "o80/base/error.hpp"
#include "runtime/journal/journal_format.hpp"

namespace o80 {

namespace {

// Blocks are built from the parts of a record that stand in one entry, so records must take as many
// blocks in memory as where they were recorded. With a larger head, the decoder must count the
// blocks itself (`what` of an entry, `blocks` of a batch).
static_assert(sizeof(RecordHead) == 48 && sizeof(BatchRecord) == kBlockBytes);
static_assert(static_cast<std::uint16_t>(RecordKind::mark) == journal_format::kMark);
static_assert(static_cast<std::uint16_t>(RecordKind::seen) == journal_format::kSeen &&
              static_cast<std::uint16_t>(RecordKind::close_plan) == 12);

template <class Struct>
void append(std::vector<std::byte>& to, const Struct& value) {
  const auto bytes = std::as_bytes(std::span(&value, 1));
  to.insert(to.end(), bytes.begin(), bytes.end());
}

/// Makes the length a multiple of `unit`.
void pad(std::vector<std::byte>& bytes, std::size_t unit) {
  bytes.resize((bytes.size() + unit - 1) / unit * unit);
}

/// Appends the blocks of the next record; false if it is invalid.
bool append_record(LittleEndianReader& get, std::vector<std::byte>& blocks) {
  std::uint16_t kind = 0;
  std::uint16_t fields = 0;
  std::uint32_t payload = 0;
  std::uint32_t here = 0;
  get.u16(kind, fields);
  get.u32(payload, here);
  LittleEndianReader list(get.bytes(fields));
  const std::span<const std::byte> part = get.bytes(here);
  if (get.failed() || here > payload) return false;
  // payloads that continue in the next entry end with a block
  const auto ends_here = [&](std::size_t head) {
    return here == payload || (head + here) % kBlockBytes == 0;
  };
  if (kind == static_cast<std::uint16_t>(RecordKind::batch)) {
    BatchRecord batch;
    if (fields != journal_format::kBatchFields || payload != 0) return false;
    journal_format::batch_fields(list, batch);
    append(blocks, batch);
    return true;
  }
  if (kind == journal_format::kMore) {
    if (fields != 0 || !ends_here(0)) return false;
  } else {
    if (kind > 0xFF || !ends_here(sizeof(RecordHead))) return false;
    RecordHead record;
    record.kind = static_cast<RecordKind>(kind);
    record.payload_bytes = payload;
    if (is_known(record.kind)) {
      if (fields != journal_format::kRecordFields) return false;
      journal_format::record_fields(list, record);
    }
    append(blocks, record);
  }
  blocks.insert(blocks.end(), part.begin(), part.end());
  pad(blocks, kBlockBytes);
  return true;
}

bool decode_records(LittleEndianReader& get, JournalItem& item) {
  while (get.left() > 0) {
    LittleEndianReader next = get;
    std::uint16_t kind = 0;
    next.u16(kind);
    if (kind == journal_format::kLost) {
      // what was read of this batch before is dropped
      item.head.kind = JournalKind::dropped;
      item.payload.clear();
      get.rest();
      return true;
    }
    if (!append_record(get, item.payload)) return false;
  }
  return true;
}

bool decode_runs(LittleEndianReader& get, JournalItem& item) {
  while (get.left() > 0) {
    JournalStatusRun run;
    StatusWord word;
    journal_format::run_fields(get, run, word);
    run.word = word.packed();
    append(item.payload, run);
  }
  return !get.failed();
}

bool decode_payload(LittleEndianReader& get, JournalItem& item) {
  const JournalKind kind = item.head.kind;
  const auto get_fields = [&]<class Struct>(Struct payload, const auto& fields) {
    fields(get, payload);
    append(item.payload, payload);
  };
  if (journal_format::visit_payload(kind, get_fields)) return !get.failed();
  if (kind == JournalKind::records) return decode_records(get, item);
  if (kind == JournalKind::statuses) return decode_runs(get, item);
  const std::span<const std::byte> bytes = get.rest();
  item.payload.assign(bytes.begin(), bytes.end());
  return true;
}

/// Decodes the entry at the begin of `bytes` into `item`; returns its length, 0 if it is invalid.
std::size_t decode_entry(std::span<const std::byte> bytes, JournalItem& item) {
  std::uint32_t length = 0;
  LittleEndianReader(bytes).u32(length);
  if (length < sizeof length || length > bytes.size()) return 0;
  LittleEndianReader get(bytes.first(length).subspan(sizeof length));
  item = {};
  journal_format::head_fields(get, item.head);
  if (get.failed()) return 0;
  if (!decode_payload(get, item) || get.left() > 0) return 0;
  pad(item.payload, 8);
  if (item.payload.size() > kMaxJournalPayload) return 0;
  item.head.words = static_cast<std::uint16_t>((sizeof item.head + item.payload.size()) / 8);
  return length;
}

[[noreturn]] void refuse_version(std::int64_t version) {
  if (version < kJournalCodec) throw InvalidArgument("the journal is damaged: it has no version");
  throw InvalidArgument("the journal was written in version " + std::to_string(version) +
                        " of the format, and this o80 reads version " +
                        std::to_string(kJournalCodec) +
                        ": read it with a newer o80. Its rows can be read with this one");
}

}  // namespace

void decode_journal(std::int64_t version, std::span<const std::byte> bytes,
                    const std::function<void(JournalItem&)>& take) {
  if (version != kJournalCodec) refuse_version(version);
  JournalItem item;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t length = decode_entry(bytes.subspan(at), item);
    if (length == 0)
      throw InvalidArgument("the journal is damaged: invalid entry at byte " + std::to_string(at));
    at += length;
    take(item);
  }
}

}  // namespace o80
