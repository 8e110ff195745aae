#include "runtime/journal/journal_decoder.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "base/printable.hpp"
#include "memory/ring/status_word.hpp"
#include "o80/describe/describe.hpp"
#include "runtime/journal/journal_records.hpp"

namespace o80 {

namespace {

constexpr std::size_t kMaxNames = 4096;  // of owners; more are a damaged journal

/// A plain struct from the payload of an entry; zeros if the payload has another size.
template <class Payload>
Payload unpacked(const JournalItem& item) {
  Payload payload{};
  if (item.payload.size() == sizeof payload) {
    std::memcpy(&payload, item.payload.data(), sizeof payload);
  }
  return payload;
}

std::string clean_text(const char* chars, std::size_t most) {
  return printable({chars, strnlen(chars, most)});
}

template <class Enum>
Enum enum_of(std::uint64_t value, std::size_t count) {
  return static_cast<Enum>(value < count ? value : 0);
}

}  // namespace

JournalDecoder::JournalDecoder(std::shared_ptr<const Description> description,
                               std::uint64_t max_kept)
    : description_(std::move(description)), max_kept_(max_kept) {}

void JournalDecoder::start_at(std::uint64_t number) {
  batches_.clear();
  kept_bytes_ = 0;
  missed_ = 0;
  entries_ = returned_ = 0;
  first_ = number;
}

/// Counts the entries in item_ that next() returns. Blocks and names are kept for later entries.
void JournalDecoder::take() {
  const std::uint64_t number = item_.head.number;
  if (number >= first_) missed_ += std::min(item_.missed, number - first_);
  entries_ = returned_ = 0;
  switch (item_.head.kind) {
    case JournalKind::records:
      keep_blocks();
      break;
    case JournalKind::dropped:
      drop(batches_.find({item_.head.lane, item_.head.id}));
      break;
    case JournalKind::owner:
      keep_name();
      break;
    case JournalKind::statuses:
      keep_statuses();
      entries_ = statuses_.size();
      returned_ = number < first_ ? std::min<std::uint64_t>(first_ - number, entries_) : 0;
      break;
    case JournalKind::at_rest:
      entries_ = shows_rests_ ? 1 : 0;
      break;
    default:
      entries_ = 1;
      break;
  }
}

bool JournalDecoder::next(JournalEntry& entry) {
  if (returned_ == entries_) return false;
  entry = {};
  if (item_.head.kind == JournalKind::statuses) {
    fill_status(entry);
  } else {
    ++returned_;
    fill(entry);
    if (item_.head.number < first_) return false;
  }
  entry.missed = std::exchange(missed_, 0);
  return true;
}

/// The statuses in item_. The number in its head is not trusted.
void JournalDecoder::keep_statuses() {
  statuses_.clear();
  const std::size_t most = std::min(item_.head.what, kMaxStatuses);
  JournalStatusRun run;
  for (std::size_t at = 0; at + sizeof run <= item_.payload.size(); at += sizeof run) {
    std::memcpy(&run, item_.payload.data() + at, sizeof run);
    for (std::uint64_t i = 0; i < run.count && statuses_.size() < most; ++i)
      statuses_.push_back({run.first_id + i, run.word});
  }
}

/// The next status in item_.
void JournalDecoder::fill_status(JournalEntry& entry) {
  const OneStatus& status = statuses_[returned_];
  const StatusWord word = StatusWord::unpack(status.word);
  entry.kind = JournalKind::status;
  entry.number = item_.head.number + returned_++;
  entry.iteration = word.iteration;
  entry.lane = item_.head.lane;
  entry.id = status.id;
  entry.status = enum_of<Status>(word.status, kStatuses);
  entry.reason = enum_of<Reason>(word.reason, kReasons);
  entry.detail = word.detail;
}

/// Joins the blocks of a batch; a batch whose first blocks were missed is not kept.
void JournalDecoder::keep_blocks() {
  const BatchKey key{item_.head.lane, item_.head.id};
  auto found = batches_.find(key);
  const std::size_t before = std::size_t{item_.head.what} * kBlockBytes;
  if (before == 0) {
    drop(found);
    found = batches_.emplace(key, Kept{}).first;
  }
  if (found == batches_.end()) return;
  std::vector<std::byte>& blocks = found->second.blocks;
  if (blocks.size() != before) return drop(found);
  blocks.insert(blocks.end(), item_.payload.begin(), item_.payload.end());
  kept_bytes_ += item_.payload.size();
  // a damaged journal may never decide on its batches
  while (kept_bytes_ > max_kept_ && !batches_.empty()) drop(batches_.begin());
}

void JournalDecoder::drop(Batches::iterator batch) {
  if (batch == batches_.end()) return;
  kept_bytes_ -= batch->second.blocks.size();
  batches_.erase(batch);
}

void JournalDecoder::keep_name() {
  if (names_.size() >= kMaxNames) names_.clear();
  const auto name = unpacked<std::array<char, sizeof(JournalOwner)>>(item_);
  names_[{item_.head.lane, item_.head.id}] = clean_text(name.data(), name.size());
}

void JournalDecoder::fill(JournalEntry& entry) {
  const JournalHead& head = item_.head;
  const auto kind = static_cast<std::uint64_t>(head.kind);
  entry.kind = enum_of<JournalKind>(kind, kJournalKinds);
  if (entry.kind == JournalKind::none) entry.unknown = "entry kind " + std::to_string(kind);
  entry.number = head.number;
  entry.iteration = head.iteration;
  entry.id = head.id;
  entry.lane = head.lane;
  switch (entry.kind) {
    case JournalKind::taken:
    case JournalKind::scheduled:
    case JournalKind::rejected:
      fill_batch(entry);
      entry.status = enum_of<Status>(head.status(), kStatuses);
      entry.reason = enum_of<Reason>(head.reason(), kReasons);
      entry.detail = head.detail();
      break;
    case JournalKind::halt:
    case JournalKind::halt_reason: {
      const auto halt = unpacked<JournalHalt>(item_);
      entry.lane = JournalEntry::kNoLane;
      entry.halt = head.id;
      entry.cause = enum_of<HaltCause>(halt.cause, kHaltCauses);
      entry.who = clean_text(halt.who.data(), halt.who.size());
      entry.text = clean_text(halt.text.data(), halt.text.size());
      break;
    }
    case JournalKind::resume:
      entry.halt = head.id;
      name(entry, unpacked<JournalSender>(item_).sender);
      break;
    case JournalKind::burst: {
      const auto burst = unpacked<JournalBurst>(item_);
      entry.burst = burst.iterations;
      name(entry, burst.sender);
      break;
    }
    case JournalKind::burst_ended:
      name(entry, unpacked<JournalSender>(item_).sender);
      entry.cut = head.what == static_cast<std::uint32_t>(BurstEnd::cut);
      break;
    case JournalKind::control_taken:
    case JournalKind::control_released:
    case JournalKind::control_lost:
    case JournalKind::died:
    case JournalKind::silent:
      name(entry, head.id);
      break;
    case JournalKind::fresh_start:
      entry.follows = head.what != 0;
      break;
    case JournalKind::interrupted:
      entry.actuator = static_cast<std::uint16_t>(head.id);
      entry.before_step = head.what != 0;
      entry.lane = JournalEntry::kNoLane;
      break;
    case JournalKind::ended: {
      const auto text = unpacked<JournalText>(item_);
      entry.text = clean_text(text.data(), text.size());
      entry.state = enum_of<BackendState>(head.what, 5);
      entry.lane = JournalEntry::kNoLane;
      break;
    }
    case JournalKind::snapshot:
      entry.lane = JournalEntry::kNoLane;
      entry.id = 0;
      entry.slot = head.what;
      if (head.id <= item_.payload.size() && item_.payload.size() - head.id < 8) {
        entry.kept.assign(item_.payload.begin(),
                          item_.payload.begin() + static_cast<std::ptrdiff_t>(head.id));
      }
      break;
    case JournalKind::chunk_begun:
      entry.row = head.what;
      fill_chunk(entry);
      break;
    case JournalKind::order_lost:
    case JournalKind::stopping:
    case JournalKind::at_rest:
      entry.lane = JournalEntry::kNoLane;
      break;
    default:
      break;
  }
}

void JournalDecoder::fill_batch(JournalEntry& entry) {
  const auto batch = unpacked<JournalBatch>(item_);
  entry.ticket = batch.ticket;
  entry.at = batch.at;
  name(entry, batch.sender);
  const auto found = batches_.find({entry.lane, entry.id});
  entry.records_lost = found == batches_.end();
  if (entry.records_lost) return;
  Kept& kept = found->second;
  if (kept.blocks.size() >= sizeof(BatchRecord)) {
    const auto record = unpack<BatchRecord>(kept.blocks.data());
    const bool until_ended = (record.flags & kBurstUntilEnded) != 0;
    entry.burst = until_ended ? -1 : std::max<std::int64_t>(record.burst, 0);
    entry.clipped = record.clipped;
  }
  entry.records = records_of(description_->schema, kept.blocks);
  entry.seen = seen_in(kept.blocks);
  // a row that was not there yet, or a claim of it
  if (entry.seen && entry.seen->since >= entry.iteration) entry.seen->since = -1;
  for (const JournalRecord& record : entry.records)
    if (entry.unknown.empty()) entry.unknown = record.unknown;
  entry.blocks = kept.blocks;
  // a scheduled batch is decided on once more
  if (entry.kind != JournalKind::scheduled || kept.scheduled) return drop(found);
  kept.scheduled = true;
}

/// Starts of numbers that the robot does not have are left out.
void JournalDecoder::fill_chunk(JournalEntry& entry) const {
  const Schema& schema = description_->schema;
  std::size_t at = sizeof entry.shift;
  if (item_.payload.size() < at) return;
  entry.shift = unpack<std::int64_t>(item_.payload.data());
  for (; at + sizeof(ChunkStart) <= item_.payload.size(); at += sizeof(ChunkStart)) {
    const auto start = unpack<ChunkStart>(item_.payload.data() + at);
    if (start.actuator >= schema.actuators.size()) continue;
    const auto type = schema.actuators[start.actuator].type;
    if (start.number < schema.scalar_count(type)) entry.starts.push_back(start);
  }
}

void JournalDecoder::name(JournalEntry& entry, std::uint64_t owner) const {
  entry.owner = owner;
  const auto found = names_.find({entry.lane, entry.owner});
  if (found != names_.end()) entry.who = found->second;
}

}  // namespace o80
