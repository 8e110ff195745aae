#include "runtime/playing/played_segment.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "describe/table.hpp"
#include "memory/segment/named_segment.hpp"
#include "memory/segment/segment_file.hpp"
#include "o80/base/error.hpp"
#include "o80/describe/describe.hpp"
#include "runtime/journal/journal_codec.hpp"
#include "runtime/journal/provenance_bytes.hpp"

namespace o80 {

namespace {

/// A quarter of it holds the largest entry.
constexpr std::uint64_t kJournalBytes = 4 << 20;

Schema schema_of(const PlayedOptions& options) {
  Schema schema = schema_from_bytes(options.description);
  schema.head.bursting = options.bursting ? 1 : 0;
  schema.head.clock = options.clock;
  return schema;
}

/// A robot that was killed may have left the only rows of its last seconds, and a halt that its
/// successor must know: a recording does not replace them.
void refuse_name_of_robot(const std::string& name) {
  const NamedSegment former = NamedSegment::open(name);
  SegmentHeader header{};
  if (!former.is_open()) return;
  former.check_owner();
  if (former.is_alive()) {
    throw SegmentTaken(former.taken_text("play the recording under another name with --prefix"));
  }
  if (!read_header(former.descriptor(), header) || (header.flags & kPlayed) != 0) return;
  throw SegmentTaken("segment '" + name +
                     "' still holds the last rows of a robot that failed or was killed. Save them "
                     "with `o80 save " +
                     name + " -o FILE.mcap` and remove it with `o80 clean " + name +
                     "`, or play under another name");
}

OwnedSegment segment_of(const PlayedOptions& options, const RowLayout& layout) {
  const std::vector<std::byte> description = to_bytes(schema_of(options));
  refuse_name_of_robot(options.segment);
  SegmentSpec spec;
  spec.name = options.segment;
  spec.schema = description;
  const std::vector<std::byte> provenance = to_bytes(options.provenance);
  spec.provenance = provenance;
  spec.row_bytes = layout.size;
  spec.rows = options.history;
  spec.lane_blocks = 64;  // only bursts are sent
  spec.journal_bytes = options.journal ? kJournalBytes : 0;
  spec.permission = options.permission;
  spec.played = true;
  return OwnedSegment::create(spec);
}

}  // namespace

PlayedSegment::PlayedSegment(const PlayedOptions& options)
    : layout_(row_layout(schema_of(options))),
      segment_(segment_of(options, layout_)),
      history_(segment_.view()),
      signal_(segment_.view()),
      halts_(segment_.view()),
      journal_(segment_.view()),
      bursts_(options.bursting ? std::make_unique<BurstServer>(segment_) : nullptr),
      row_(layout_.size / 8) {}

PlayedSegment::~PlayedSegment() {
  // also the files of one that ended as failed: the recording holds its rows
  segment_.end_and_remove();
}

Iteration PlayedSegment::add_journal(std::span<const std::byte> entries, std::int64_t codec) {
  Iteration last = -1;
  decode_journal(codec, entries, [&](JournalItem& item) {
    last = item.head.iteration;
    added_.push_back(std::move(item));
  });
  return last;
}

void PlayedSegment::write_journal(Iteration k) {
  for (; !added_.empty() && added_.front().head.iteration <= k; added_.pop_front()) {
    const JournalItem& item = added_.front();
    journal_.skip_to(item.head.number);
    journal_.write(item.head, item.payload.data(), item.payload.size());
    note(item);
  }
}

/// Notes what the segment shows beside its rows.
void PlayedSegment::note(const JournalItem& item) {
  const JournalHead& head = item.head;
  const std::span<const std::byte> payload = item.payload;
  const bool is_halt = head.kind == JournalKind::halt || head.kind == JournalKind::halt_reason;
  if (is_halt && payload.size() >= sizeof(JournalHalt)) {
    const auto halt = unpack<JournalHalt>(payload.data());
    recorded_halt_ = {
        .number = head.id,
        .cause = static_cast<HaltCause>(std::min<std::uint64_t>(halt.cause, kHaltCauses - 1)),
        .iteration = head.iteration,
        .who = halt.who,
        .text = halt.text};
    recorded_halt_.who.back() = recorded_halt_.text.back() = 0;
  } else if (head.kind == JournalKind::ended) {
    const auto* text = reinterpret_cast<const char*>(payload.data());
    const bool failed = head.what == static_cast<std::uint32_t>(BackendState::failed);
    recorded_end_ = {failed ? BackendState::failed : BackendState::stopped,
                     std::string(text, strnlen(text, payload.size()))};
  }
}

std::size_t PlayedSegment::count(std::span<const std::byte> rows) const {
  if (rows.size() % layout_.size == 0) return rows.size() / layout_.size;
  throw InvalidArgument("rows of '" + segment_.name() + "' have " + std::to_string(layout_.size) +
                        " bytes, " + std::to_string(rows.size()) + " bytes were given");
}

const std::byte* PlayedSegment::row(std::span<const std::byte> rows, std::size_t i) const {
  return rows.data() + i * layout_.size;
}

std::size_t PlayedSegment::publish(std::span<const std::byte> rows,
                                   std::span<const std::int64_t> due,
                                   const KeepWaiting& keep_waiting) {
  segment_.check_process();
  const std::size_t all = count(rows);
  if (!due.empty() && due.size() != all)
    throw InvalidArgument("publish needs a due time for each row");
  for (std::size_t i = 0; i < all; ++i) {
    if (stop_.load(std::memory_order_relaxed)) return i;
    if (!due.empty() && !wait_until(due[i], keep_waiting)) return i;
    const bool wakes = publish_one(row(rows, i));
    wake_sleepers(segment_.view(), {.rows = wakes});
  }
  return all;
}

std::size_t PlayedSegment::serve(std::span<const std::byte> rows, const KeepWaiting& keep_waiting) {
  segment_.check_process();
  const std::size_t all = count(rows);
  std::size_t served = 0;
  if (last_ < 0 && all > 0) {  // row 0 needs no burst
    publish(rows.first(layout_.size), {});
    served = 1;
  }
  while (served < all && wait_for_burst(keep_waiting)) {
    const bool wakes = publish_one(row(rows, served));
    bursts_->count(last_, wakes);
    ++served;
  }
  return served;
}

bool PlayedSegment::wait_for_burst(const KeepWaiting& keep_waiting) {
  if (!bursts_) throw InvalidArgument("'" + segment_.name() + "' is not played by bursts");
  while (!stop_.load(std::memory_order_relaxed)) {
    if (bursts_->may_begin(kSlice)) return true;
    if (keep_waiting && !keep_waiting()) return false;
  }
  return false;
}

/// False if the player must stop.
bool PlayedSegment::wait_until(std::int64_t due, const KeepWaiting& keep_waiting) {
  while (true) {
    const std::int64_t left = due - monotonic_now();
    if (left <= 0) return true;
    const std::int64_t nap = std::min(left, kSlice);
    usleep(static_cast<useconds_t>(nap / 1000 + 1));
    if (stop_.load(std::memory_order_relaxed)) return false;
    if (nap == kSlice && keep_waiting && !keep_waiting()) return false;
  }
}

bool PlayedSegment::publish_one(const std::byte* row) {
  const auto head = unpack<RowHead>(row);
  if (head.iteration <= last_)
    throw InvalidArgument("the rows of '" + segment_.name() + "' are not in order: row " +
                          std::to_string(head.iteration) + " follows row " + std::to_string(last_));
  // a copy, because the words of a row are read with their alignment
  std::memcpy(row_.data(), row, layout_.size);
  write_journal(head.iteration);
  show_halt(head.iteration, head.halted != 0);
  if (head.iteration != last_ + 1) history_.skip_to(head.iteration);
  const bool is_first = last_ < 0;
  last_ = head.iteration;
  history_.publish(last_, reinterpret_cast<const std::byte*>(row_.data()));
  if (is_first) segment_.set_state(BackendState::running);
  return signal_.announce(last_);
}

/// Shows a halt from its first row to its last, with the number and the reason that the journal
/// has.
void PlayedSegment::show_halt(Iteration k, bool halted) {
  const Halt& recorded = recorded_halt_;
  const bool is_new = halted && recorded.number > halts_.halt().number;
  if (halts_.acts() && (!halted || is_new)) {
    while (!halts_.clear()) halts_.poll();
  }
  if (!halted || halts_.acts()) return;
  if (recorded.number > 0) {
    segment_.view().bell().halts.store(recorded.number - 1, std::memory_order_seq_cst);
    request_halt(segment_.view(), recorded.cause, recorded.who_text(), recorded.reason());
  } else {
    request_halt(segment_.view(), HaltCause::none, {}, {});
  }
  halts_.poll();
  halts_.show(recorded.number > 0 ? recorded.iteration : k);
}

void PlayedSegment::end() {
  if (segment_.state() != BackendState::starting && segment_.state() != BackendState::running)
    return;
  write_journal(last_ + 1);
  const auto& [state, text] = recorded_end_;
  segment_.end(state, text);
}

void PlayedSegment::ask_to_stop() noexcept {
  stop_.store(true, std::memory_order_relaxed);
  ring_bell(segment_.view());
}

}  // namespace o80
