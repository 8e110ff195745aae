#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/little_endian.hpp"
#include "control/batch/record.hpp"
#include "o80/memory/journal_kind.hpp"
#include "runtime/journal/journal_format.hpp"

namespace o80 {

/// Writes entries as they are in memory in the format of files (journal_format.hpp). `Layout` names
/// the structs in memory. Arbitrary entries are safe.
///
/// One object encodes the entries of one journal in their order, because records of a batch may
/// span several of them.
template <class Layout>
class JournalEncoder {
 public:
  using Head = typename Layout::Head;
  /// Appends one entry to `to`.
  void encode(const Head& head, std::span<const std::byte> payload, std::vector<std::byte>& to);

  /// A note in a batch that was encoded.
  struct Mark {
    std::int64_t iteration = 0;  // in which the backend read it
    std::string text;            // as it was sent: any bytes
  };
  /// The marks since the last call.
  std::vector<Mark> take_marks() { return std::exchange(marks_, {}); }

 private:
  using Batch = typename Layout::Batch;
  using Record = typename Layout::Record;
  /// The batch of a lane whose blocks were read last.
  struct Open {
    std::uint64_t id = 0;
    std::uint64_t blocks = 0;  // read so far; 0: none, or the batch is invalid
    std::uint64_t left = 0;    // bytes of the last record's payload that were not read
    bool in_mark = false;      // the last record is a mark, with this text
    std::string text{};
  };

  template <class Struct>
  static Struct loaded(std::span<const std::byte> bytes) {
    Struct loaded{};  // entries of the first recordings are shorter
    if (!bytes.empty()) std::memcpy(&loaded, bytes.data(), std::min(bytes.size(), sizeof loaded));
    return loaded;
  }
  void put_payload(LittleEndianWriter& put, const Head& head, std::span<const std::byte> payload);
  void put_records(LittleEndianWriter& put, const Head& head, std::span<const std::byte> blocks);
  void put_record(LittleEndianWriter& put, Open& open, std::int64_t iteration,
                  std::span<const std::byte>& blocks);
  static void put_lengths(LittleEndianWriter& put, std::uint16_t kind, std::size_t fields,
                          std::uint64_t payload, std::uint64_t here) {
    put.u16(kind, fields);
    put.u32(payload, here);
  }

  std::array<Open, 256> open_{};  // by lane
  std::vector<Mark> marks_;
};

template <class Layout>
void JournalEncoder<Layout>::encode(const Head& head, std::span<const std::byte> payload,
                                    std::vector<std::byte>& to) {
  const std::size_t begin = to.size();
  LittleEndianWriter put(to);
  put.u32(0);
  journal_format::head_fields(put, head);
  put_payload(put, head, payload);
  put.set_u32(begin, to.size() - begin);
}

template <class Layout>
void JournalEncoder<Layout>::put_payload(LittleEndianWriter& put, const Head& head,
                                         std::span<const std::byte> payload) {
  const auto kind = static_cast<JournalKind>(head.kind);
  const auto put_fields = [&]<class Struct>(Struct, const auto& fields) {
    const auto found = loaded<Struct>(payload);
    fields(put, found);
  };
  if (journal_format::visit_payload<Layout>(kind, put_fields)) return;
  if (kind == JournalKind::records) return put_records(put, head, payload);
  if (kind != JournalKind::statuses) return put.bytes(payload);
  using Run = typename Layout::Run;
  for (; payload.size() >= sizeof(Run); payload = payload.subspan(sizeof(Run))) {
    const auto run = loaded<Run>(payload);
    const auto word = Layout::unpack(run.word);
    journal_format::run_fields(put, run, word);
  }
}

template <class Layout>
void JournalEncoder<Layout>::put_records(LittleEndianWriter& put, const Head& head,
                                         std::span<const std::byte> blocks) {
  Open& open = open_[head.lane & 0xFF];
  const std::size_t count = blocks.size() / Layout::kBlock;
  const bool is_whole = count > 0 && blocks.size() % Layout::kBlock == 0;
  const bool begins = is_whole && head.what == 0 && Layout::is_batch(blocks.front());
  const bool goes_on =
      is_whole && open.blocks > 0 && open.id == head.id && open.blocks == head.what;
  if (!begins && !goes_on) {
    open = {};
    return put_lengths(put, journal_format::kLost, 0, 0, 0);
  }
  if (begins) {
    open = {.id = head.id};
    const auto batch = loaded<Batch>(blocks);
    put_lengths(put, Layout::kBatchKind, journal_format::kBatchFields, 0, 0);
    journal_format::batch_fields(put, batch);
    blocks = blocks.subspan(Layout::kBlock);
  }
  open.blocks += count;
  while (!blocks.empty()) put_record(put, open, head.iteration, blocks);
}

/// Writes the next record in `blocks`, or what they hold of the payload of the one before, and
/// takes it off them.
template <class Layout>
void JournalEncoder<Layout>::put_record(LittleEndianWriter& put, Open& open, std::int64_t iteration,
                                        std::span<const std::byte>& blocks) {
  const bool begins = open.left == 0;
  const std::size_t head = begins ? sizeof(Record) : 0;
  const auto record = loaded<Record>(blocks.first(head));
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
  const std::size_t taken = (head + here + Layout::kBlock - 1) / Layout::kBlock * Layout::kBlock;
  blocks = blocks.subspan(taken);
}

}  // namespace o80
