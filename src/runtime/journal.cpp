#include "o80/runtime/journal.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <utility>

#include "base/printable.hpp"
#include "memory/journal.hpp"
#include "memory/status_word.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/decision_journal.hpp"
#include "runtime/journal_records.hpp"
#include "runtime/link.hpp"

namespace o80 {

namespace {

constexpr std::size_t kMostNames = 4096;  // of owners; more are a damaged journal

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

/// The burst that a batch asks for; -1 until it has ended, 0: none.
std::int64_t burst_of(const std::vector<std::byte>& blocks) {
  BatchRecord batch;
  std::memcpy(&batch, blocks.data(), sizeof batch);
  return (batch.flags & kBurstUntilEnded) != 0 ? -1 : std::max<std::int64_t>(batch.burst, 0);
}

}  // namespace

class Journal::Body {
 public:
  explicit Body(std::shared_ptr<Link> link)
      : link_(std::move(link)), reader_(link_->segment.view()) {}

  bool exists() const { return reader_.has_journal(); }
  void seek(std::uint64_t number) {
    forget();
    // from the oldest entry on: blocks of a batch lie before the decision on it
    reader_ = JournalReader(link_->segment.view());
    first_ = number;
  }
  void seek_end() {
    forget();
    reader_.seek_end();
    first_ = 0;
  }
  bool next(JournalEntry& entry);

 private:
  using BatchKey = std::pair<std::uint32_t, CommandId>;  // lane and id

  void forget() {
    batches_.clear();
    kept_bytes_ = 0;
    missed_ = 0;
    statuses_ = told_ = 0;
  }
  void keep_blocks();
  void drop(std::map<BatchKey, std::vector<std::byte>>::iterator batch);
  void keep_name();
  bool next_status(JournalEntry& entry);
  void fill(JournalEntry& entry);
  void fill_batch(JournalEntry& entry);
  void name(JournalEntry& entry) const;

  std::shared_ptr<Link> link_;
  JournalReader reader_;
  JournalItem item_;
  std::size_t statuses_ = 0;                            // of item_
  std::size_t told_ = 0;                                // of them
  std::uint64_t first_ = 0;                             // number of the first entry to give
  std::uint64_t missed_ = 0;                            // entries missed since the last one given
  std::map<BatchKey, std::vector<std::byte>> batches_;  // blocks of batches without a decision
  std::uint64_t kept_bytes_ = 0;
  std::map<BatchKey, std::string> names_;  // by lane and incarnation
};

bool Journal::Body::next(JournalEntry& entry) {
  link_->check_usable();
  while (true) {
    // the statuses of one entry come one by one
    if (next_status(entry)) return true;
    if (!reader_.next(item_)) return false;
    const std::uint64_t number = item_.head.number;
    if (number >= first_) missed_ += std::min(item_.missed, number - first_);
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
      case JournalKind::status:
        statuses_ =
            std::min<std::size_t>(item_.head.what, item_.payload.size() / sizeof(JournalStatus));
        told_ = number < first_ ? std::min<std::uint64_t>(first_ - number, statuses_) : 0;
        break;
      default:
        entry = {};
        fill(entry);
        if (number < first_) break;
        entry.missed = std::exchange(missed_, 0);
        return true;
    }
  }
}

/// The next status of the entry that was read last; false if it has no more.
bool Journal::Body::next_status(JournalEntry& entry) {
  if (told_ == statuses_) return false;
  JournalStatus status;
  std::memcpy(&status, item_.payload.data() + told_ * sizeof status, sizeof status);
  const StatusWord word = StatusWord::unpack(status.word);
  entry = {};
  entry.kind = JournalKind::status;
  entry.number = item_.head.number + told_++;
  entry.missed = std::exchange(missed_, 0);
  entry.iteration = word.iteration;
  entry.lane = item_.head.lane;
  entry.id = status.id;
  entry.status = enum_of<Status>(word.status, kStatuses);
  entry.reason = enum_of<Reason>(word.reason, kReasons);
  entry.detail = word.detail;
  return true;
}

/// Joins the blocks of a batch; a batch whose first blocks were missed is not kept.
void Journal::Body::keep_blocks() {
  const BatchKey key{item_.head.lane, item_.head.id};
  auto found = batches_.find(key);
  const std::size_t before = std::size_t{item_.head.what} * kBlockBytes;
  if (before == 0) {
    drop(found);
    found = batches_.emplace(key, std::vector<std::byte>()).first;
  }
  if (found == batches_.end()) return;
  if (found->second.size() != before) return drop(found);
  found->second.insert(found->second.end(), item_.payload.begin(), item_.payload.end());
  kept_bytes_ += item_.payload.size();
  // a damaged journal may never decide on its batches
  const std::uint64_t most = std::uint64_t{link_->segment.view().shape.lanes} *
                             link_->segment.view().shape.lane_blocks * kBlockBytes;
  while (kept_bytes_ > most && !batches_.empty()) drop(batches_.begin());
}

void Journal::Body::drop(std::map<BatchKey, std::vector<std::byte>>::iterator batch) {
  if (batch == batches_.end()) return;
  kept_bytes_ -= batch->second.size();
  batches_.erase(batch);
}

void Journal::Body::keep_name() {
  if (names_.size() >= kMostNames) names_.clear();
  const auto name = unpacked<std::array<char, sizeof(JournalOwner)>>(item_);
  names_[{item_.head.lane, item_.head.id}] = clean_text(name.data(), name.size());
}

void Journal::Body::fill(JournalEntry& entry) {
  const JournalHead& head = item_.head;
  entry.kind = enum_of<JournalKind>(static_cast<std::uint64_t>(head.kind), kJournalKinds);
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
      break;
    case JournalKind::burst:
      entry.burst = unpacked<std::int64_t>(item_);
      break;
    case JournalKind::burst_ended:
      entry.cut = head.what == static_cast<std::uint32_t>(BurstEnd::cut);
      break;
    case JournalKind::control_taken:
    case JournalKind::control_released:
    case JournalKind::control_lost:
    case JournalKind::died:
    case JournalKind::silent:
      entry.owner = head.id;
      name(entry);
      break;
    case JournalKind::interrupted:
      entry.actuator = static_cast<std::uint16_t>(head.id);
      entry.lane = JournalEntry::kNoLane;
      break;
    case JournalKind::ended: {
      const auto text = unpacked<JournalText>(item_);
      entry.text = clean_text(text.data(), text.size());
      entry.state = enum_of<BackendState>(head.what, 5);
      entry.lane = JournalEntry::kNoLane;
      break;
    }
    case JournalKind::order_lost:
    case JournalKind::stopping:
      entry.lane = JournalEntry::kNoLane;
      break;
    default:
      break;
  }
}

void Journal::Body::fill_batch(JournalEntry& entry) {
  const auto batch = unpacked<JournalBatch>(item_);
  entry.ticket = batch.ticket;
  entry.at = batch.at;
  entry.owner = batch.sender;
  name(entry);
  const auto found = batches_.find({entry.lane, entry.id});
  entry.records_lost = found == batches_.end();
  if (entry.records_lost) return;
  entry.blocks = found->second;
  entry.burst = burst_of(entry.blocks);
  entry.records = records_of(link_->description->schema, entry.blocks);
  // a scheduled batch is decided on once more
  if (entry.kind != JournalKind::scheduled) drop(found);
}

void Journal::Body::name(JournalEntry& entry) const {
  const auto found = names_.find({entry.lane, entry.owner});
  if (found != names_.end()) entry.who = found->second;
}

Journal::Journal(const UntypedFrontend& frontend)
    : body_(std::make_unique<Body>(frontend.link())) {}
Journal::Journal(Journal&&) noexcept = default;
Journal& Journal::operator=(Journal&&) noexcept = default;
Journal::~Journal() = default;

bool Journal::exists() const { return body_->exists(); }
bool Journal::next(JournalEntry& entry) { return body_->next(entry); }
void Journal::seek(std::uint64_t number) { body_->seek(number); }
void Journal::seek_end() { body_->seek_end(); }

}  // namespace o80
