#include "runtime/journal/journal_encoder.hpp"

#include <algorithm>
#include <cstring>

#include "control/batch/record.hpp"
#include "memory/ring/status_word.hpp"
#include "runtime/journal/journal_format.hpp"

namespace o80 {

namespace {

constexpr auto kBatchKind = static_cast<std::byte>(RecordKind::batch);

template <class Struct>
Struct loaded(std::span<const std::byte> bytes) {
  Struct loaded{};
  if (!bytes.empty()) std::memcpy(&loaded, bytes.data(), std::min(bytes.size(), sizeof loaded));
  return loaded;
}

void put_lengths(LittleEndianWriter& put, std::uint16_t kind, std::size_t fields,
                 std::uint64_t payload, std::uint64_t here) {
  put.u16(kind, fields);
  put.u32(payload, here);
}

}  // namespace

void JournalEncoder::encode(const JournalHead& head, std::span<const std::byte> payload,
                            std::vector<std::byte>& to) {
  const std::size_t begin = to.size();
  LittleEndianWriter put(to);
  put.u32(0);
  journal_format::head_fields(put, head);
  put_payload(put, head, payload);
  put.set_u32(begin, to.size() - begin);
}

void JournalEncoder::put_payload(LittleEndianWriter& put, const JournalHead& head,
                                 std::span<const std::byte> payload) {
  const auto put_fields = [&]<class Struct>(Struct, const auto& fields) {
    const auto found = loaded<Struct>(payload);
    fields(put, found);
  };
  if (journal_format::visit_payload(head.kind, put_fields)) return;
  if (head.kind == JournalKind::records) return put_records(put, head, payload);
  if (head.kind != JournalKind::statuses) return put.bytes(payload);
  using Run = JournalStatusRun;
  for (; payload.size() >= sizeof(Run); payload = payload.subspan(sizeof(Run))) {
    const auto run = loaded<Run>(payload);
    const auto word = StatusWord::unpack(run.word);
    journal_format::run_fields(put, run, word);
  }
}

void JournalEncoder::put_records(LittleEndianWriter& put, const JournalHead& head,
                                 std::span<const std::byte> blocks) {
  Open& open = open_[head.lane & 0xFF];
  const std::size_t count = blocks.size() / kBlockBytes;
  const bool is_whole = count > 0 && blocks.size() % kBlockBytes == 0;
  const bool begins = is_whole && head.what == 0 && blocks.front() == kBatchKind;
  const bool continues =
      is_whole && open.blocks > 0 && open.id == head.id && open.blocks == head.what;
  if (!begins && !continues) {
    open = {};
    return put_lengths(put, journal_format::kLost, 0, 0, 0);
  }
  if (begins) {
    open = {.id = head.id};
    const auto batch = loaded<BatchRecord>(blocks);
    put_lengths(put, static_cast<std::uint16_t>(RecordKind::batch), journal_format::kBatchFields, 0,
                0);
    journal_format::batch_fields(put, batch);
    blocks = blocks.subspan(kBlockBytes);
  }
  open.blocks += count;
  while (!blocks.empty()) put_record(put, open, head.iteration, blocks);
}

/// Writes the next record in `blocks`, or what they hold of the payload of the one before, and
/// takes it off them.
void JournalEncoder::put_record(LittleEndianWriter& put, Open& open, std::int64_t iteration,
                                std::span<const std::byte>& blocks) {
  const bool begins = open.left == 0;
  const std::size_t head = begins ? sizeof(RecordHead) : 0;
  const auto record = loaded<RecordHead>(blocks.first(head));
  if (begins) {
    open.left = record.payload_bytes;
    open.in_mark = static_cast<std::uint16_t>(record.kind) == journal_format::kMark &&
                   open.left > 0 && open.left <= kMaxMarkBytes;
    open.text.clear();
  }
  const std::uint64_t here = std::min<std::uint64_t>(open.left, blocks.size() - head);
  if (begins) {
    put_lengths(put, static_cast<std::uint16_t>(record.kind), journal_format::kRecordFields,
                record.payload_bytes, here);
    journal_format::record_fields(put, record);
  } else {
    put_lengths(put, journal_format::kMore, 0, here, here);
  }
  put.bytes(blocks.subspan(head, here));
  open.left -= here;
  if (open.in_mark) {
    const auto part = blocks.subspan(head, here);
    open.text.append(reinterpret_cast<const char*>(part.data()), part.size());
    if (open.left == 0) marks_.push_back({iteration, open.text});
  }
  // padding up to the next block
  blocks = blocks.subspan((head + here + kBlockBytes - 1) / kBlockBytes * kBlockBytes);
}

}  // namespace o80
