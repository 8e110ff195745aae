#include "runtime/journal/journal_author.hpp"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "memory/os/atomic_words.hpp"

namespace o80 {

JournalAuthor::JournalAuthor(const SegmentView& view)
    : writer_(view),
      view_(view),
      named_(view.shape.lanes),
      acts_(writer_.is_on()),
      half_(writer_.bytes() / 2) {}

void JournalAuthor::begin_blocks(std::uint32_t lane, std::uint64_t sender,
                                 std::uint32_t most) noexcept {
  if (!writer_.is_on()) return;
  if (sender != 0 && named_[lane].incarnation != sender) name_owner(lane, sender);
  name_again(lane, sender);
  flush();
  writer_.begin(std::size_t{most} * kBlockBytes);
}

void JournalAuthor::end_blocks(std::uint32_t lane, CommandId batch, std::uint32_t first) noexcept {
  writer_.end(head(JournalKind::records, lane, batch, first));
}

void JournalAuthor::name_owner(std::uint32_t lane, std::uint64_t incarnation) noexcept {
  Named& named = named_[lane];
  named.incarnation = incarnation;
  named.position = writer_.position();
  const auto& owner = view_.lane(lane).owner;
  load_text(owner, std::size(owner), reinterpret_cast<char*>(named.name.data()));
  write(head(JournalKind::owner, lane, incarnation), named.name.data(), sizeof named.name);
}

/// Repeats the name once in each half of the ring, so that a reader that comes late finds it, also
/// when the owner has left the lane.
void JournalAuthor::name_again(std::uint32_t lane, std::uint64_t incarnation) noexcept {
  if (!writer_.is_on()) return;
  Named& named = named_[lane];
  if (incarnation == 0 || named.incarnation != incarnation || !is_far(named)) return;
  named.position = writer_.position();
  write(head(JournalKind::owner, lane, incarnation), named.name.data(), sizeof named.name);
}

void JournalAuthor::dropped(std::uint32_t lane, CommandId batch) noexcept {
  note(JournalKind::dropped, lane, batch);
}

namespace {
JournalBatch payload_of(const StagedBatch& sent) noexcept {
  return {sent.ticket, sent.sender_left ? 0 : sent.incarnation, sent.at};
}
}  // namespace

void JournalAuthor::scheduled(const StagedBatch& sent, CommandId batch) noexcept {
  const JournalBatch payload = payload_of(sent);
  write(head(JournalKind::scheduled, sent.lane, batch), &payload, sizeof payload);
}

void JournalAuthor::decided(const StagedBatch& sent, const StatusChange& change) noexcept {
  const auto kind = change.status == Status::rejected ? JournalKind::rejected : JournalKind::taken;
  const JournalBatch payload = payload_of(sent);
  write(head(kind, change.lane, change.id,
             JournalHead::how(static_cast<std::uint8_t>(change.status),
                              static_cast<std::uint8_t>(change.reason), change.detail)),
        &payload, sizeof payload);
}

void JournalAuthor::begun(const ChunkBegin& chunk) noexcept {
  flush();
  const auto starts = std::as_bytes(chunk.starts);
  if (!writer_.fits(sizeof chunk.shift + starts.size())) return;
  writer_.begin(sizeof chunk.shift + starts.size());
  writer_.add(reinterpret_cast<const std::byte*>(&chunk.shift), sizeof chunk.shift);
  writer_.add(starts.data(), starts.size());
  writer_.end(head(JournalKind::chunk_begun, chunk.lane, chunk.id, chunk.row));
}

void JournalAuthor::statuses(std::uint32_t lane, JournalStatusRun run) noexcept {
  if (!writer_.is_on()) return;
  while (run.count > 0) {
    if (statuses_ == kMaxStatuses || status_lane_ != lane) flush();
    status_lane_ = lane;
    const std::uint64_t count = std::min<std::uint64_t>(run.count, kMaxStatuses - statuses_);
    JournalStatusRun* const last = statuses_ > 0 ? &runs_[runs_used_ - 1] : nullptr;
    if (last != nullptr && run.first_id == last->first_id + last->count && run.word == last->word) {
      last->count += count;
    } else {
      runs_[runs_used_++] = {run.first_id, count, run.word};
    }
    statuses_ += static_cast<std::uint32_t>(count);
    run.first_id += count;
    run.count -= count;
  }
}

void JournalAuthor::write_statuses() noexcept {
  writer_.write(head(JournalKind::statuses, status_lane_, 0, statuses_), runs_.data(),
                runs_used_ * sizeof(JournalStatusRun));
  statuses_ = runs_used_ = 0;
}

void JournalAuthor::halt(JournalKind halt_or_reason, const Halt& halt) noexcept {
  acts();
  const JournalHalt payload{static_cast<std::uint64_t>(halt.cause), halt.who, halt.text};
  write(head(halt_or_reason, 0, halt.number), &payload, sizeof payload);
}

void JournalAuthor::resume(std::uint32_t lane, std::uint64_t sender, std::uint64_t halt) noexcept {
  acts();
  name_again(lane, sender);
  const JournalSender payload{sender};
  write(head(JournalKind::resume, lane, halt), &payload, sizeof payload);
}

void JournalAuthor::kept(const KeptState& state) noexcept {
  constexpr std::array<std::byte, 8> kPadding{};
  const std::size_t rest = state.bytes.size() % kPadding.size();
  const std::size_t padding = rest == 0 ? 0 : kPadding.size() - rest;
  flush();
  if (!writer_.fits(state.bytes.size() + padding)) return;
  writer_.begin(state.bytes.size() + padding);
  const std::size_t whole = state.bytes.size() - rest;
  writer_.add(state.bytes.data(), whole);
  if (rest != 0) {
    std::array<std::byte, 8> last = kPadding;
    std::memcpy(last.data(), state.bytes.data() + whole, rest);
    writer_.add(last.data(), last.size());
  }
  writer_.end(head(JournalKind::snapshot, 0, state.bytes.size(), state.slot));
}

void JournalAuthor::died(std::uint32_t lane, std::uint64_t owner, Stale stale) noexcept {
  acts();
  name_again(lane, owner);
  note(JournalKind::died, lane, owner, static_cast<std::uint32_t>(stale));
}

void JournalAuthor::silent(std::uint32_t lane, std::uint64_t owner, Stale stale) noexcept {
  acts();
  name_again(lane, owner);
  note(JournalKind::silent, lane, owner, static_cast<std::uint32_t>(stale));
}

void JournalAuthor::burst(std::uint32_t lane, CommandId batch, const JournalBurst& burst) noexcept {
  name_again(lane, burst.sender);
  write(head(JournalKind::burst, lane, batch), &burst, sizeof burst);
}

void JournalAuthor::burst_ended(std::uint32_t lane, std::uint64_t sender, CommandId batch,
                                Iteration row, BurstEnd how) noexcept {
  name_again(lane, sender);
  JournalHead entry = head(JournalKind::burst_ended, lane, batch, static_cast<std::uint32_t>(how));
  entry.iteration = row;
  const JournalSender payload{sender};
  write(entry, &payload, sizeof payload);
}

void JournalAuthor::ended(BackendState state, std::string_view text) noexcept {
  JournalText payload{};
  text.copy(payload.data(), payload.size() - 1);
  write(head(JournalKind::ended, 0, 0, static_cast<std::uint32_t>(state)), payload.data(),
        payload.size());
}

}  // namespace o80
