#include "control/sending/batch_builder.hpp"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <limits>

#include "o80/base/error.hpp"

namespace o80 {

std::byte* BatchBuilder::open(const RecordHead& head, std::uint64_t payload_bytes) {
  const std::size_t first = blocks_.size();
  const std::uint64_t all = first + blocks_of(payload_bytes);
  if (payload_bytes > std::numeric_limits<std::uint32_t>::max() ||
      all > std::numeric_limits<std::uint32_t>::max()) {
    throw LaneFull("a batch of " + std::to_string(all) +
                   " blocks is larger than any lane: send it in several pulses");
  }
  blocks_.resize(all);
  RecordHead written = head;
  written.payload_bytes = static_cast<std::uint32_t>(payload_bytes);
  std::byte* bytes = blocks_[first].bytes.data();
  std::memcpy(bytes, &written, sizeof written);
  ++counts_[static_cast<std::size_t>(head.kind)];
  if (head.kind != RecordKind::member) ++records_;
  return bytes + sizeof written;
}

std::uint32_t BatchBuilder::add(const RecordHead& head, std::span<const std::byte> payload) {
  std::byte* bytes = open(head, payload.size());
  if (!payload.empty()) std::memcpy(bytes, payload.data(), payload.size());
  return records_ - 1;
}

/// Calls add(), which adds a group and its members; if it throws, nothing is added.
template <class Add>
std::uint32_t BatchBuilder::add_group(Add&& add) {
  const std::size_t before = blocks_.size();
  const auto counts = counts_;
  const std::uint32_t records = records_;
  try {
    add();
  } catch (...) {
    blocks_.resize(before);
    counts_ = counts;
    records_ = records;
    throw;
  }
  return records_ - 1;
}

void BatchBuilder::open_group(const Member& first, std::size_t members,
                              std::span<const std::byte> payload) {
  RecordHead head = first.head;
  head.kind = RecordKind::group;
  head.actuator = 0;
  head.masked = 0;
  head.rows = static_cast<std::uint32_t>(members);
  add(head, payload);
}

std::uint32_t BatchBuilder::group(std::span<const Member> members,
                                  std::span<const std::int64_t> times, std::uint32_t rows) {
  assert(!members.empty());
  return add_group([&] {
    open_group(members.front(), members.size(), {});
    for (const Member& member : members) {
      add_command(member, RecordKind::member, times, rows);
    }
  });
}

std::uint32_t BatchBuilder::chunk(std::span<const Member> members, const ChunkHead& chunk,
                                  std::span<const std::uint32_t> due,
                                  std::span<const StateLayout* const> layouts) {
  assert(!members.empty() && members.size() == layouts.size());
  std::array<std::byte, kChunkGroupBytes> payload{};
  ChunkHead written = chunk;
  written.rows = static_cast<std::uint32_t>(due.size());
  std::memcpy(payload.data() + payload.size() - sizeof written, &written, sizeof written);
  return add_group([&] {
    for (std::size_t i = 0; i < members.size(); ++i) {
      Member member = members[i];
      member.head.mode = Mode::overwrite;
      member.head.pace = Pace::chunk;
      if (i == 0) open_group(member, members.size(), payload);
      add_rows(member, due, *layouts[i]);
    }
  });
}

void BatchBuilder::add_rows(const Member& member, std::span<const std::uint32_t> due,
                            const StateLayout& layout) {
  RecordHead head = member.head;
  head.kind = RecordKind::member;
  head.masked = member.mask.empty() ? 0 : 1;
  head.rows = static_cast<std::uint32_t>(due.size());
  const ChunkPlaces places(head.rows, layout, head.masked != 0);
  assert(member.states.size() == due.size() * layout.size());
  std::byte* const bytes = open(head, places.payload_bytes);
  if (!member.mask.empty()) std::memcpy(bytes, member.mask.data(), member.mask.size_bytes());
  std::byte* const blocks = bytes - sizeof head;
  std::byte* const notes = blocks + std::size_t{places.blocks_before_notes()} * kBlockBytes;
  for (std::size_t first = 0; first < due.size(); first += RowNote::kRows) {
    const auto of_note =
        due.subspan(first, std::min<std::size_t>(RowNote::kRows, due.size() - first));
    std::byte* const note = notes + first / RowNote::kRows * places.blocks_of_note * kBlockBytes;
    std::memcpy(note + offsetof(RowNote, due), of_note.data(), of_note.size_bytes());
  }
  std::memcpy(blocks + std::size_t{places.blocks_before_rows()} * kBlockBytes, member.states.data(),
              member.states.size());
}

void BatchBuilder::add_command(const Member& member, RecordKind kind,
                               std::span<const std::int64_t> times, std::uint32_t rows) {
  const auto& [of, mask, states] = member;
  assert(times.empty() || (times.size() == rows && of.pace == Pace::duration));
  RecordHead head = of;
  head.kind = kind;
  head.masked = mask.empty() ? 0 : 1;
  head.rows = rows;
  std::byte* bytes = open(head, mask.size_bytes() + times.size_bytes() + states.size_bytes());
  for (const auto part : {std::as_bytes(mask), std::as_bytes(times), states}) {
    if (!part.empty()) std::memcpy(bytes, part.data(), part.size());
    bytes += part.size();
  }
}

std::uint32_t BatchBuilder::mark(std::string_view text) {
  if (text.empty() || text.size() > kMaxMarkBytes) {
    throw InvalidArgument("a mark has 1 to " + std::to_string(kMaxMarkBytes) +
                          " bytes of text, got " + std::to_string(text.size()));
  }
  return add(head_of(RecordKind::mark), std::as_bytes(std::span(text)));
}

std::span<const Block> BatchBuilder::seal(const BatchRecord& batch) {
  BatchRecord written = batch;
  written.kind = RecordKind::batch;
  written.records = records_;
  written.clipped = clipped_;
  written.blocks = static_cast<std::uint32_t>(blocks());
  const bool is_express = !has_commands() && requests() == 0 && of(RecordKind::mark) == 0 &&
                          of(RecordKind::close_plan) == 0 && records_ > 0 &&
                          blocks() <= 1 + kMaxExpressRecords && batch.at == kNow &&
                          batch.burst == 0 && (batch.flags & kBurstUntilEnded) == 0;
  if (is_express) written.flags |= kExpress;
  std::memcpy(blocks_.front().bytes.data(), &written, sizeof written);

  // records get the ids after the batch's two; members get the id of their group
  RecordHead head;
  std::uint32_t place = 0;
  for (std::size_t block = 1; block < blocks_.size(); block += blocks_of(head.payload_bytes)) {
    std::byte* bytes = blocks_[block].bytes.data();
    std::memcpy(&head, bytes, sizeof head);
    if (head.kind != RecordKind::member) ++place;
    head.id = record_id(batch.id, place - 1);
    std::memcpy(bytes, &head, sizeof head);
  }
  if (seen_) {
    SeenBlock seen{head_of(RecordKind::seen, static_cast<std::uint16_t>(seen_->clock)),
                   seen_->epoch, seen_->time};
    seen.head.amount = seen_->iteration;
    seen.head.id = static_cast<CommandId>(seen_->since);
    seen.head.payload_bytes = sizeof seen - sizeof seen.head;
    std::memcpy(blocks_.emplace_back().bytes.data(), &seen, sizeof seen);
  }
  return blocks_;
}

}  // namespace o80
