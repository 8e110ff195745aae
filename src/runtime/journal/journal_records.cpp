#include "runtime/journal/journal_records.hpp"

#include <cstring>
#include <string>
#include <string_view>
#include <utility>

#include "control/batch/chunk.hpp"
#include "control/batch/record.hpp"
#include "o80/describe/describe.hpp"

namespace o80 {

namespace {

/// A record in the blocks of a batch: its head and its payload.
struct Piece {
  RecordHead head;
  std::span<const std::byte> payload;
};

/// Takes the next record off `blocks`; empty if it does not fit.
std::optional<Piece> take_piece(std::span<const std::byte>& blocks) {
  Piece piece;
  if (blocks.size() < kBlockBytes) return std::nullopt;
  std::memcpy(&piece.head, blocks.data(), sizeof piece.head);
  const std::uint64_t bytes = blocks_of(piece.head.payload_bytes) * kBlockBytes;
  if (bytes > blocks.size()) return std::nullopt;
  piece.payload = blocks.subspan(sizeof piece.head, piece.head.payload_bytes);
  blocks = blocks.subspan(bytes);
  return piece;
}

template <class Number>
std::vector<Number> numbers_of(std::span<const std::byte> bytes) {
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), numbers.size() * sizeof(Number));
  return numbers;
}

PaceSpec pace_of(const RecordHead& head) {
  if (head.pace == Pace::speed) return speed(head.speed);
  return {head.pace, head.amount, 0};
}

bool has_times(const RecordHead& head) { return head.pace == Pace::duration && head.rows > 1; }

/// Adds the rows of a member of a chunk; false if the payload has another size.
bool add_rows(const Schema& schema, const Piece& piece, JournalRecord& record) {
  const RecordHead& head = piece.head;
  const std::uint32_t type = schema.actuators[head.actuator].type;
  const ChunkPlaces places(head.rows, schema.types[type].size, schema.scalar_count(type),
                           head.masked != 0);
  if (head.rows == 0 || head.rows > kMaxChunkRows || piece.payload.size() != places.payload_bytes) {
    return false;
  }
  const auto at = [](std::uint32_t block) { return block * kBlockBytes - sizeof(RecordHead); };
  JournalRecord::Target target;
  target.actuator = head.actuator;
  const std::size_t words = head.masked != 0 ? mask_words(schema.scalar_count(type)) : 0;
  target.mask = numbers_of<std::uint64_t>(piece.payload.first(8 * words));
  const auto rows = piece.payload.subspan(at(places.blocks_before_rows()));
  target.states.assign(rows.begin(), rows.end());
  record.targets.push_back(std::move(target));
  record.due.resize(head.rows);
  for (std::uint32_t i = 0; i < head.rows; ++i) {
    const std::uint32_t note =
        places.blocks_before_notes() + i / RowNote::kRows * places.blocks_of_note;
    std::memcpy(&record.due[i],
                piece.payload.data() + at(note) + offsetof(RowNote, due) + i % RowNote::kRows * 4,
                4);
  }
  return true;
}

ChunkOptions options_of(const ChunkHead& chunk, Profile profile) {
  return {.anchor = chunk.anchor,
          .epoch = chunk.epoch,
          .plan = chunk.plan,
          .ease = chunk.ease,
          .first = chunk.first,
          .fixed = chunk.fixed != 0,
          .reject_late = chunk.reject_late != 0,
          .final = chunk.final != 0,
          .profile = profile};
}

/// Adds the target of a command or of a member; false if the payload has another size.
bool add_target(const Schema& schema, const Piece& piece, JournalRecord& record) {
  const RecordHead& head = piece.head;
  if (head.actuator >= schema.actuators.size()) return false;
  if (is_chunk(head)) return add_rows(schema, piece, record);
  const std::uint64_t states =
      std::uint64_t{schema.types[schema.actuators[head.actuator].type].size} * head.rows;
  const std::uint64_t times = has_times(head) ? std::uint64_t{head.rows} * 8 : 0;
  if (states + times > piece.payload.size()) return false;
  const std::size_t mask = piece.payload.size() - states - times;
  if ((head.masked != 0) != (mask > 0) || mask % 8 != 0) return false;

  JournalRecord::Target target;
  target.actuator = head.actuator;
  target.mask = numbers_of<std::uint64_t>(piece.payload.first(mask));
  const auto rows = piece.payload.subspan(mask + times);
  target.states.assign(rows.begin(), rows.end());
  record.row_times = numbers_of<std::int64_t>(piece.payload.subspan(mask, times));
  record.targets.push_back(std::move(target));
  return true;
}

/// The enumeration of a command whose value this o80 does not know; else empty.
std::string unknown_in(const RecordHead& head) {
  const auto check = [](std::string_view name, auto value) -> std::string {
    if (to_text(value) != "unknown") return {};
    return std::string(name) + " " + std::to_string(static_cast<int>(value));
  };
  for (std::string found : {check("mode", head.mode), check("pace", head.pace),
                            check("profile", head.profile), check("start", head.start)})
    if (!found.empty()) return found;
  return {};
}

JournalRecord unknown_record(std::string what) {
  JournalRecord record;
  record.kind = JournalRecord::Kind::unknown;
  record.unknown = std::move(what);
  return record;
}

std::string unknown_kind(RecordKind kind) {
  return "record kind " + std::to_string(static_cast<int>(kind));
}

JournalRecord command_of(const RecordHead& head) {
  if (std::string unknown = unknown_in(head); !unknown.empty())
    return unknown_record(std::move(unknown));
  JournalRecord record;
  record.pace = pace_of(head);
  record.mode = head.mode;
  record.profile = head.profile;
  record.start = head.start;
  record.rows = head.rows;
  return record;
}

/// A command of several actuators: `rows` of its head is the number of members that follow.
std::optional<JournalRecord> take_group(const Schema& schema, const Piece& piece,
                                        std::span<const std::byte>& blocks) {
  const RecordHead& head = piece.head;
  JournalRecord record = command_of(head);
  if (is_chunk(head)) {
    ChunkHead chunk;
    if (piece.payload.size() != kChunkGroupBytes) return std::nullopt;
    std::memcpy(&chunk, piece.payload.data() + kChunkGroupBytes - sizeof chunk, sizeof chunk);
    record.chunk = options_of(chunk, head.profile);
  }
  for (std::uint32_t i = 0; i < head.rows; ++i) {
    const std::optional<Piece> member = take_piece(blocks);
    if (!member) return std::nullopt;
    if (!is_known(member->head.kind)) record = unknown_record(unknown_kind(member->head.kind));
    if (!record.unknown.empty()) continue;
    if (member->head.kind != RecordKind::member) return std::nullopt;
    record.rows = member->head.rows;
    if (!add_target(schema, *member, record)) return std::nullopt;
  }
  return record;
}

std::optional<JournalRecord> take_record(const Schema& schema, std::span<const std::byte>& blocks) {
  using Kind = JournalRecord::Kind;
  const std::optional<Piece> piece = take_piece(blocks);
  if (!piece) return std::nullopt;
  const RecordHead& head = piece->head;
  JournalRecord record;
  switch (head.kind) {
    case RecordKind::command:
      record = command_of(head);
      if (record.kind != Kind::unknown && !add_target(schema, *piece, record)) return std::nullopt;
      break;
    case RecordKind::group: {
      std::optional<JournalRecord> group = take_group(schema, *piece, blocks);
      if (!group) return std::nullopt;
      record = std::move(*group);
      break;
    }
    case RecordKind::purge:
      record.kind = Kind::purge;
      record.actuator = head.actuator;
      record.only_own = head.only_own != 0;
      break;
    case RecordKind::request:
      if (head.actuator >= schema.requests.size()) return std::nullopt;
      record.kind = Kind::request;
      record.request = head.actuator;
      record.payload.assign(piece->payload.begin(), piece->payload.end());
      break;
    case RecordKind::take_control:
      record.kind = Kind::take_control;
      break;
    case RecordKind::release_control:
      record.kind = Kind::release_control;
      break;
    case RecordKind::close_plan:
      record.kind = Kind::close_plan;
      break;
    case RecordKind::resume:
      record.kind = Kind::resume;
      record.halt = static_cast<std::uint64_t>(head.amount);
      break;
    case RecordKind::mark:
      record.kind = Kind::mark;
      record.text.assign(reinterpret_cast<const char*>(piece->payload.data()),
                         piece->payload.size());
      break;
    default:
      if (is_known(head.kind)) return std::nullopt;
      return unknown_record(unknown_kind(head.kind));
  }
  record.id = head.id;
  return record;
}

}  // namespace

std::vector<JournalRecord> records_of(const Schema& schema, std::span<const std::byte> blocks) {
  std::vector<JournalRecord> records;
  if (blocks.size() < kBlockBytes) return records;
  const auto batch = unpack<BatchRecord>(blocks.data());
  blocks = blocks.subspan(kBlockBytes);
  for (std::uint32_t i = 0; i < batch.records && !blocks.empty(); ++i) {
    std::optional<JournalRecord> record = take_record(schema, blocks);
    if (!record) break;
    records.push_back(std::move(*record));
  }
  return records;
}

std::optional<Seen> seen_in(std::span<const std::byte> blocks) {
  if (blocks.size() < kBlockBytes) return std::nullopt;
  const auto batch = unpack<BatchRecord>(blocks.data());
  blocks = blocks.subspan(kBlockBytes);
  // it lies behind the records, members of the last one included
  for (std::uint32_t records = 0; !blocks.empty();) {
    const std::span<const std::byte> from = blocks;
    const std::optional<Piece> piece = take_piece(blocks);
    if (!piece) return std::nullopt;
    if (piece->head.kind == RecordKind::member || records++ < batch.records) continue;
    const auto last = unpack<SeenBlock>(from.data());
    const bool is_row = last.head.kind == RecordKind::seen && blocks.empty() &&
                        last.head.payload_bytes == sizeof last - sizeof last.head &&
                        last.head.amount >= 0 && last.head.amount <= kMaxIterations &&
                        last.head.actuator <= static_cast<std::uint16_t>(Clock::simulated);
    if (!is_row) return std::nullopt;
    const auto since = static_cast<Iteration>(last.head.id);
    return Seen{last.epoch, last.head.amount, last.time, static_cast<Clock>(last.head.actuator),
                since >= 0 && since <= kMaxIterations ? since : -1};
  }
  return std::nullopt;
}

}  // namespace o80
