#include "control/batch_builder.hpp"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <limits>

#include "o80/base/error.hpp"

namespace o80 {
namespace {

RecordHead head_of(RecordKind kind, std::uint16_t actuator = 0) {
  RecordHead head;
  head.kind = kind;
  head.actuator = actuator;
  return head;
}

}  // namespace

BatchBuilder::BatchBuilder() : blocks_(1) {}

std::byte* BatchBuilder::open(const RecordHead& head, std::uint64_t payload_bytes) {
  const std::uint64_t all = blocks_.size() + blocks_of(payload_bytes);
  if (payload_bytes > std::numeric_limits<std::uint32_t>::max() ||
      all > std::numeric_limits<std::uint32_t>::max()) {
    throw LaneFull("a batch of " + std::to_string(all) +
                   " blocks is larger than any lane: send it in several pulses");
  }
  const std::size_t first = blocks_.size();
  blocks_.resize(all);
  RecordHead written = head;
  written.payload_bytes = static_cast<std::uint32_t>(payload_bytes);
  std::byte* bytes = blocks_[first].bytes.data();
  std::memcpy(bytes, &written, sizeof written);
  if (head.kind == RecordKind::member) return bytes + sizeof written;  // of a group
  ++records_;
  switch (head.kind) {
    case RecordKind::command:
    case RecordKind::group:
      ++commands_;
      break;
    case RecordKind::request:
    case RecordKind::resume:
      ++requests_;
      break;
    case RecordKind::take_control:
    case RecordKind::release_control:
      ++control_orders_;
      break;
    case RecordKind::mark:
      ++marks_;
      break;
    default:
      break;
  }
  return bytes + sizeof written;
}

std::uint32_t BatchBuilder::command(const RecordHead& head, std::span<const std::uint64_t> mask,
                                    std::span<const std::int64_t> times, std::uint32_t rows,
                                    std::span<const std::byte> states) {
  RecordHead written = head;
  written.kind = RecordKind::command;
  add_command(written, mask, times, rows, states);
  return records_ - 1;
}

std::uint32_t BatchBuilder::group(std::span<const Member> members,
                                  std::span<const std::int64_t> times, std::uint32_t rows) {
  assert(!members.empty());
  const std::size_t before = blocks_.size();
  RecordHead head = members.front().head;
  head.kind = RecordKind::group;
  head.actuator = 0;
  head.masked = 0;
  head.rows = static_cast<std::uint32_t>(members.size());
  open(head, 0);
  try {
    for (const Member& member : members) {
      RecordHead written = member.head;
      written.kind = RecordKind::member;
      add_command(written, member.mask, times, rows, member.states);
    }
  } catch (...) {
    // remove the incomplete group
    blocks_.resize(before);
    --records_;
    --commands_;
    throw;
  }
  return records_ - 1;
}

void BatchBuilder::add_command(const RecordHead& head, std::span<const std::uint64_t> mask,
                               std::span<const std::int64_t> times, std::uint32_t rows,
                               std::span<const std::byte> states) {
  assert(times.empty() || (times.size() == rows && head.pace == Pace::duration));
  RecordHead written = head;
  written.masked = mask.empty() ? 0 : 1;
  written.rows = rows;
  std::byte* bytes = open(written, mask.size_bytes() + times.size_bytes() + states.size_bytes());
  for (const auto part : {std::as_bytes(mask), std::as_bytes(times), states}) {
    if (!part.empty()) std::memcpy(bytes, part.data(), part.size());
    bytes += part.size();
  }
}

std::uint32_t BatchBuilder::purge(std::uint16_t actuator_or_every) {
  open(head_of(RecordKind::purge, actuator_or_every), 0);
  return records_ - 1;
}

std::uint32_t BatchBuilder::purge_own(std::uint16_t actuator_or_every) {
  RecordHead head = head_of(RecordKind::purge, actuator_or_every);
  head.only_own = 1;
  open(head, 0);
  return records_ - 1;
}

std::uint32_t BatchBuilder::request(std::uint16_t index, std::span<const std::byte> payload) {
  std::byte* bytes = open(head_of(RecordKind::request, index), payload.size());
  if (!payload.empty()) std::memcpy(bytes, payload.data(), payload.size());
  return records_ - 1;
}

std::uint32_t BatchBuilder::take_control() {
  open(head_of(RecordKind::take_control), 0);
  return records_ - 1;
}

std::uint32_t BatchBuilder::release_control() {
  open(head_of(RecordKind::release_control), 0);
  return records_ - 1;
}

std::uint32_t BatchBuilder::resume(std::uint64_t number, bool accept_reading) {
  RecordHead head = head_of(RecordKind::resume);
  head.accepts = accept_reading ? 1 : 0;
  head.amount = static_cast<std::int64_t>(number);
  open(head, 0);
  return records_ - 1;
}

std::uint32_t BatchBuilder::mark(std::string_view text) {
  if (text.empty() || text.size() > kMostMarkBytes) {
    throw InvalidArgument("a mark has 1 to " + std::to_string(kMostMarkBytes) +
                          " bytes of text, got " + std::to_string(text.size()));
  }
  const std::span<const std::byte> bytes = std::as_bytes(std::span(text));
  std::ranges::copy(bytes, open(head_of(RecordKind::mark), bytes.size()));
  return records_ - 1;
}

std::span<const Block> BatchBuilder::seal(const BatchRecord& batch) {
  BatchRecord written = batch;
  written.kind = RecordKind::batch;
  written.records = records_;
  written.blocks = static_cast<std::uint32_t>(blocks_.size());
  if (is_express(batch)) written.flags |= kExpress;
  std::memcpy(blocks_.front().bytes.data(), &written, sizeof written);

  // records get the ids after the batch's two; members get the id of their group
  std::size_t block = 1;
  for (std::uint32_t place = 0; place < records_; ++place) {
    const CommandId id = record_id(batch.id, place);
    RecordHead head;
    std::memcpy(&head, blocks_[block].bytes.data(), sizeof head);
    block = set_id(block, id);
    const std::uint32_t members = head.kind == RecordKind::group ? head.rows : 0;
    for (std::uint32_t i = 0; i < members; ++i) block = set_id(block, id);
  }
  return blocks_;
}

bool BatchBuilder::is_express(const BatchRecord& batch) const noexcept {
  return commands_ + requests_ + marks_ == 0 && records_ > 0 && records_ <= kMostExpressRecords &&
         batch.at == kNow && batch.burst == 0 && (batch.flags & kBurstUntilEnded) == 0;
}

/// Sets the id of the record at `block`; returns the block after the record.
std::size_t BatchBuilder::set_id(std::size_t block, CommandId id) {
  std::byte* bytes = blocks_[block].bytes.data();
  RecordHead head;
  std::memcpy(&head, bytes, sizeof head);
  head.id = id;
  std::memcpy(bytes, &head, sizeof head);
  return block + blocks_of(head.payload_bytes);
}

void BatchBuilder::clear() {
  blocks_.resize(1);
  records_ = commands_ = requests_ = control_orders_ = marks_ = 0;
}

}  // namespace o80
